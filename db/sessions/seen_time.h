/// The latest time that the server's clock has shown, to detect a clock that later is behind it. Retention
/// counts a recording's age from such times (retention_store.h).
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"

namespace needlelab {

/// A clock set back by up to this much was corrected by a time server: neither noted nor reported.
inline constexpr std::int64_t kClockSlack_ns = 3'600'000'000'000;
/// A clock further ahead of the latest time is not trusted until a person confirms it.
inline constexpr std::int64_t kMaxAhead_ns = 31LL * 86'400 * 1'000'000'000;

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class SeenTimeStore {
 public:
  explicit SeenTimeStore(Connection& connection) : connection_(connection) {}

  /// The latest time noted; before the first note, the latest time at which a session was closed or the
  /// database made. 0: unknown.
  Result<std::int64_t> latest();
  /// Notes the clock's time if it is later than the latest time, by at most kMaxAhead_ns. Otherwise the
  /// latest time stays, and aheadText() reports it, also after a restart, until confirm() or until the clock
  /// is set back.
  Status note(std::int64_t now_unix_ns);
  /// Notes the time of a close like note(). If the clock is behind, also notes that the session was closed at
  /// the latest time or later. Call in the transaction that closes the session.
  Status noteClose(const Uuid& session, std::int64_t now_unix_ns);
  /// A person confirms the clock: its time becomes the latest, even if it is behind (the clock was ahead
  /// before) or further ahead than note() trusts. Notes about sessions stay.
  Status confirm(std::int64_t now_unix_ns);

  /// Sessions closed while the clock was behind, each with the earliest possible time of its close.
  Result<std::map<Uuid, std::int64_t>> closedBehind();
  /// A warning if the clock is behind the latest time; else empty.
  Result<std::string> behindText(std::int64_t now_unix_ns);
  /// A warning if the clock is more than kMaxAhead_ns ahead of the latest time (it jumped, or nothing ran
  /// for that long); else empty.
  Result<std::string> aheadText(std::int64_t now_unix_ns);

 private:
  Connection& connection_;
};

}  // namespace needlelab
