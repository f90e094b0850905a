/// Options of a load run, and the plan of its faults.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/device/hand/hand.h"
#include "common/base/result.h"
#include "common/wire/endpoint.h"

namespace needlelab::test {

struct LoadOptions {
  std::size_t stations = 10;  ///< [1, 4000]
  std::size_t viewers = 1;    ///< [0, 100]; each watches its share of the stations at full rate
  double seconds = 10;        ///< of streaming, [0.1, 7200]
  std::uint64_t seed = 1;
  std::size_t gestures = 24;  ///< in the pool

  // servers of one lab that already run; otherwise the run starts its own
  Endpoints server;
  std::filesystem::path ca_file;        ///< with `server`
  std::string user = "load";            ///< with `server`: an administrator
  std::filesystem::path password_file;  ///< with `server`

  // the run's own servers
  /// Names of the run's own servers that work together on `store`, connected by their own NATS: 2 to
  /// kMaxServers. Empty: one server, alone.
  std::vector<std::string> servers;
  std::filesystem::path bin;  ///< the folder of needlelab-server
  std::string store;          ///< an empty PostgreSQL database for it; empty: SQLite
  /// The postmaster.pid of the database's standby on this computer, to measure its cost; empty: no standby.
  std::filesystem::path standby;

  bool faults = false;        ///< random faults (FaultPlan); only with the run's own server
  double fault_every_s = 10;  ///< on average
  bool quiet = false;         ///< no progress on standard error
};

inline constexpr std::size_t kMaxServers = 8;

/// Which of `servers` servers a station asks first: a viewer that asks server `viewer % servers` first
/// watches stations of every server (LoadViewer). Without viewers the stations take turns.
std::size_t firstServerOf(std::size_t station, std::size_t viewers, std::size_t servers);

/// kInvalidInput states the option, its value and the allowed range.
Status checkOptions(const LoadOptions& options);

struct PlannedFault {
  enum class Kind : std::uint8_t {
    kCut,         ///< cuts connections of some stations silently
    kKillServer,  ///< kill -9; restarted after `time`
    kSlowViewer,  ///< reads nothing for `time`
  };
  Kind kind = Kind::kCut;
  std::vector<std::size_t> who;  ///< stations or viewers
  std::chrono::milliseconds time{0};
};

inline constexpr double kKillShare = 0.25;  ///< the share of a run in which the server may be killed

/// Exponential times between faults, `fault_every_s` on average. The first is a cut, the second a kill, so
/// that a short run has both; later kills come only in the first part (kKillShare): after it one server lives
/// long enough to show whether its memory stays flat. The same seed plans the same faults. Thread: one.
class FaultPlan {
 public:
  explicit FaultPlan(const LoadOptions& options);

  /// Returns the fault due at this time of the run, if any. Call it often.
  std::optional<PlannedFault> at(double time_s);

 private:
  void planNext();
  std::size_t stations_, viewers_;
  double every_s_, seconds_, next_s_ = 0;
  std::uint64_t count_ = 0;
  HandRandom random_;
};

}  // namespace needlelab::test
