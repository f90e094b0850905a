/// The hashes of open sessions, as far as closes have read them. Private to db/service.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/sessions/session_store.h"

namespace needlelab {

/// Stored chunks never change, so each is read and hashed once, however often a station tries to close its
/// session: an attempt with a wrong hash does not cost the session's length again. In memory, about 500 bytes
/// per session: after a start, and for all but the most recent sessions, reading starts over. Thread: every
/// function is thread-safe.
class RunningHashes {
 public:
  /// The number of sessions that one station may have open (StationQuotas).
  static constexpr std::size_t kMaxSessions = 1000;
  /// Bytes that one call of goOn() reads, counted as in SessionStore::hashOn(): about 40 ms.
  static constexpr std::uint64_t kMaxBytesAtOnce = std::uint64_t{16} << 20;

  /// Continues reading chunks 0 … chunks−1 of an open session. Nothing: there are more, call again. Errors:
  /// as SessionStore::hashOn.
  Result<std::optional<HashedChunks>> goOn(SessionStore& sessions, const Uuid& session, std::uint64_t chunks);
  /// To be called when the session is closed.
  void forget(const Uuid& session);

  /// Bytes of chunks read since the start.
  [[nodiscard]] std::uint64_t bytesHashed() const;
  [[nodiscard]] std::size_t sessions() const;

 private:
  struct Kept {
    HashSoFar so_far;
    std::uint64_t used = 0;  // turn_ when it was stored
  };
  /// Takes the cached state; a concurrent call starts over.
  HashSoFar take(const Uuid& session);
  void keep(const Uuid& session, const HashSoFar& so_far, std::uint64_t read_bytes);

  mutable std::mutex mutex_;  // guards everything below
  std::map<Uuid, Kept> kept_;
  std::uint64_t turn_ = 0;
  std::uint64_t bytes_hashed_ = 0;
};

}  // namespace needlelab
