/// What one station may bring, so that one stolen or mistaken key cannot fill the disk and the lists.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "common/base/result.h"

namespace needlelab {

/// Each share but the first is there at once and comes back evenly within a day: a station that was offline
/// for weeks delivers in one go, and one that is used up goes on in the same day. In memory: a restart of the
/// server gives every station its whole shares again. Memory: some 100 bytes a station that opened a session.
/// Times: steady clock (ns), from the caller, never going back. Thread: one.
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

 private:
  struct Used {
    double description_bytes = 0, unknown_names = 0;
    std::int64_t at_ns = 0;
  };
  const Settings settings_;
  std::unordered_map<std::string, Used> used_;
};

}  // namespace needlelab
