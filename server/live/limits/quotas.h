/// What one station or account may store, so that a stolen key or password, or a faulty program, cannot fill
/// the disk and the lists.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "needlelab/types.pb.h"
#include "server/live/limits/limits.h"
#include "server/live/limits/token_bucket.h"

namespace needlelab {

/// Limits per station; all but the number of open sessions are shares of a day. In memory: a restart of the
/// server restores all shares. Times: steady clock (ns), from the caller, never decreasing. Thread: one.
class StationQuotas {
 public:
  using Settings = StationLimits;
  /// The cost of a chunk's rows, in addition to its own bytes.
  static constexpr std::size_t kChunkRowBytes = 256;
  /// A session is opened only if at least 1 / kChunksAtOnce of the chunks' share is left (32 MiB; restored
  /// within 6 min). So a station at its limit retries every few minutes, instead of losing its connection at
  /// each chunk.
  static constexpr double kChunksAtOnce = 256;

  /// A chunk that is new to the server.
  struct NewChunk {
    std::uint64_t bytes = 0;
    bool undecodable = false;
  };
  /// A session that is new to the server.
  struct NewSession {
    std::uint64_t open_sessions = 0;  ///< of this station, without this one
    std::uint64_t description_bytes = 0;
    bool unknown_name = false;  ///< its trainee's name matches no one, and no stored session has it
  };

  explicit StationQuotas(const Settings& settings = {}) : settings_(settings) {}

  /// Charges the session to the station's shares. kNoRoom: one is not sufficient; then nothing is charged,
  /// and the message says which, why, and the remedy.
  Status admit(const std::string& station, const NewSession& session, std::int64_t now_ns);
  /// Charges a chunk likewise.
  Status admitChunk(const std::string& station, const NewChunk& chunk, std::int64_t now_ns);
  /// kNoRoom while too little is left of the chunks' share to open a session, new or known. Charges nothing.
  Status roomForChunks(const std::string& station, std::int64_t now_ns);

 private:
  const Settings settings_;
  TokenBuckets descriptions_, names_, chunks_, undecodable_;
};

/// A daily share per account, over all its connections on both ports, for requests that store (Storing in
/// db/service/requests/requests.h). Otherwise like StationQuotas.
class PeopleShares {
 public:
  using Settings = AccountLimits;
  /// The cost of a request in addition to its own bytes: its row, its lines in the audit log (an undelivered
  /// message has two) and their indices.
  static constexpr std::size_t kRequestBytes = 2048;

  explicit PeopleShares(const Settings& settings = {}) : settings_(settings) {}

  /// Charges a request of `bytes` to the account's share. kNoRoom: the share is not sufficient; then nothing
  /// is charged, and the message states the share and when there is room.
  Status admit(const std::string& name, pb::Role role, std::size_t bytes, std::int64_t now_ns);

 private:
  const Settings settings_;
  TokenBuckets used_;
};

}  // namespace needlelab
