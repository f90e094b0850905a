/// The hashes of open sessions, so far as closes have read them. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/session_store.h"

namespace needlelab {

/// Stored chunks never change, so each is read and hashed once, however often a station tries to close its
/// session: a try with a wrong hash costs nothing of the session's length. In memory, some 500 bytes a
/// session: after a start, and of all but the sessions that were tried last, it is read anew. Thread: every
/// function is thread-safe.
class RunningHashes {
 public:
  /// As many as one station may have open (StationQuotas).
  static constexpr std::size_t kMostSessions = 1000;
  /// What one call of goOn() reads, as SessionStore::hashOn() counts: some 40 ms.
  static constexpr std::uint64_t kMostBytesAtOnce = std::uint64_t{16} << 20;

  /// Reads on in an open session's chunks 0 … chunks−1. Nothing: there are more, call it again. Errors: as
  /// SessionStore::hashOn.
  Result<std::optional<HashedChunks>> goOn(SessionStore& sessions, const Uuid& session, std::uint64_t chunks);
  /// Of a session that is closed now.
  void forget(const Uuid& session);

  /// Bytes of chunks that were read since the start.
  [[nodiscard]] std::uint64_t bytesHashed() const;
  [[nodiscard]] std::size_t sessions() const;

 private:
  struct Kept {
    HashSoFar so_far;
    std::uint64_t used = 0;  // turn_ when it was kept
  };
  /// So far as it is kept, and removed from here; another call meanwhile begins anew.
  HashSoFar take(const Uuid& session);
  void keep(const Uuid& session, const HashSoFar& so_far, std::uint64_t read_bytes);

  mutable std::mutex mutex_;  // guards all below
  std::map<Uuid, Kept> kept_;
  std::uint64_t turn_ = 0;
  std::uint64_t bytes_hashed_ = 0;
};

}  // namespace needlelab
