/// What one station or one account may have stored, so that one stolen key or password, or a program with a
/// mistake, cannot fill the disk and the lists.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "needlelab/types.pb.h"
#include "server/live/limits.h"
#include "server/live/token_bucket.h"

namespace needlelab {

/// Each share but the first is one of a day. In memory: a restart of the server gives every station its whole
/// shares again. Times: steady clock (ns), from the caller, never going back. Thread: one.
class StationQuotas {
 public:
  using Settings = StationLimits;
  /// What a chunk costs besides its own bytes: its rows.
  static constexpr std::size_t kChunkRowBytes = 256;
  /// A session is opened with at least 1 / kChunksAtOnce of the chunks' share left (32 MiB; back within 6
  /// min): at its end a station asks for some minutes, and does not lose its connection at each chunk.
  static constexpr double kChunksAtOnce = 256;

  /// A chunk that is new to the server.
  struct NewChunk {
    std::uint64_t bytes = 0;
    bool undecodable = false;
  };
  /// A session that is new to the server.
  struct NewSession {
    std::uint64_t open_sessions = 0;  ///< that this station has already
    std::uint64_t description_bytes = 0;
    bool unknown_name = false;  ///< its trainee's name is nobody's, and no stored session has it
  };

  explicit StationQuotas(const Settings& settings = {}) : settings_(settings) {}

  /// Takes the session's parts of the station's shares. kNoRoom: one does not suffice; nothing is taken then,
  /// and the message says which, why, and what to do.
  Status admit(const std::string& station, const NewSession& session, std::int64_t now_ns);
  /// The same for a chunk.
  Status admitChunk(const std::string& station, const NewChunk& chunk, std::int64_t now_ns);
  /// kNoRoom while too little is left of the chunks' share to open a session, new or known. Takes nothing.
  Status roomForChunks(const std::string& station, std::int64_t now_ns);

 private:
  const Settings settings_;
  TokenBuckets descriptions_, names_, chunks_, undecodable_;
};

/// A share of a day for each account, over all of its connections on both ports, of the requests that store
/// (Storing in db/service/requests.h). Otherwise as above.
class PeopleShares {
 public:
  using Settings = AccountLimits;
  /// What a request costs besides its own bytes: its row, its lines in the audit log (a message that is not
  /// delivered has two), their indices.
  static constexpr std::size_t kRequestBytes = 2048;

  explicit PeopleShares(const Settings& settings = {}) : settings_(settings) {}

  /// Takes a request of `bytes` from the account's share. kNoRoom: it does not suffice; nothing is taken
  /// then, and the message gives the share and when there is room.
  Status admit(const std::string& name, pb::Role role, std::size_t bytes, std::int64_t now_ns);

 private:
  const Settings settings_;
  TokenBuckets used_;
};

}  // namespace needlelab
