/// The latest time that the server's clock has shown, so that a clock which is behind it later is noticed.
/// Retention counts the age of a recording from such times (retention_store.h).
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"

namespace needlelab {

/// A clock that is back by up to this was put right by a time server: neither noted nor told.
inline constexpr std::int64_t kClockSlack_ns = 3'600'000'000'000;
/// A clock that is further ahead of the latest time is not believed until a person says that it is right.
inline constexpr std::int64_t kMostAhead_ns = 31LL * 86'400 * 1'000'000'000;

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class SeenTimeStore {
 public:
  explicit SeenTimeStore(Connection& connection) : connection_(connection) {}

  /// The latest time noted; before the first note, the latest time at which a session was closed or the
  /// database made. 0: nothing says one.
  Result<std::int64_t> latest();
  /// Notes what the clock shows, if it is later than the latest, by kMostAhead_ns at most: else the latest
  /// stays, and aheadText() says so also after a restart, until confirm() or until the clock was set back.
  Status note(std::int64_t now_unix_ns);
  /// Notes the time of a close as note() does. If the clock is behind, notes of the session that it was
  /// closed at the latest time or after it. In the transaction that closes the session.
  Status noteClose(const Uuid& session, std::int64_t now_unix_ns);
  /// A person says that the clock is right: it is the latest time from now on, also if it is behind, because
  /// then it was ahead before, or further ahead than note() believes. What was noted of sessions stays.
  Status confirm(std::int64_t now_unix_ns);

  /// The sessions that were closed while the clock was behind, each with the time at which it was closed at
  /// the earliest.
  Result<std::map<Uuid, std::int64_t>> closedBehind();
  /// What a person should know when the clock is behind the latest time; else empty.
  Result<std::string> behindText(std::int64_t now_unix_ns);
  /// What a person should know when the clock is further ahead of the latest time than kMostAhead_ns: it has
  /// jumped, or nothing ran for so long. Else empty.
  Result<std::string> aheadText(std::int64_t now_unix_ns);

 private:
  Connection& connection_;
};

}  // namespace needlelab
