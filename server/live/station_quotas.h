/// What one station may bring, so that one stolen or mistaken key cannot fill the disk and the lists.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>

#include "common/base/result.h"
#include "server/live/day_share.h"

namespace needlelab {

/// Each share but the first is one of a day (DayShare): a station that was offline for weeks delivers in one
/// go, and one that is used up goes on in the same day. In memory: a restart of the server gives every
/// station its whole shares again. Memory: some 150 bytes a station that opened a session. Times: steady
/// clock (ns), from the caller, never going back. Thread: one.
class StationQuotas {
 public:
  struct Settings {
    /// Open at once. A station has one or two; more are left behind by crashes with a lost spool. As many as
    /// a Welcome names (kMaxWelcomed).
    std::uint64_t open_sessions = 1000;
    /// Of descriptions with the profile, which each session brings whole: 10 kB is usual, 1 MB the largest.
    /// 6,000 usual sessions.
    double description_bytes = 64.0 * 1024 * 1024;
    /// Names of trainees that nobody has and no session had: each waits in the managers' list. A class of 30
    /// who mistype their names every day of a week.
    double unknown_names = 200;
    /// Of stored chunks. A day and night at 1 kHz are 600 MB, a full spool is 4 GiB.
    double chunk_bytes = 8.0 * 1024 * 1024 * 1024;
    /// Of them, that cannot be decoded (Appended::quarantined). An honest station has none; one whose program
    /// makes them by mistake keeps them in its spool.
    double undecodable_bytes = 256.0 * 1024 * 1024;
  };
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

  StationQuotas() : StationQuotas(Settings{}) {}
  explicit StationQuotas(const Settings& settings) : settings_(settings) {}

  /// Takes the session's parts of the station's shares. kNoRoom: one does not suffice; nothing is taken then,
  /// and the message says which, why, and what to do.
  Status admit(const std::string& station, const NewSession& session, std::int64_t now_ns);
  /// The same for a chunk.
  Status admitChunk(const std::string& station, const NewChunk& chunk, std::int64_t now_ns);
  /// kNoRoom while too little is left of the chunks' share to open a session, new or known. Takes nothing.
  Status roomForChunks(const std::string& station, std::int64_t now_ns);

 private:
  struct Used {
    DayShare description_bytes, unknown_names, chunk_bytes, undecodable_bytes;
  };
  const Settings settings_;
  std::unordered_map<std::string, Used> used_;
};

}  // namespace needlelab
