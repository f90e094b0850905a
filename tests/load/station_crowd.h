/// A part of a run's stations on one network thread, and their schedule.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tests/load/load_shared.h"
#include "tests/load/load_station.h"

namespace needlelab::test {

/// The crowd's current state.
struct CrowdState {
  std::size_t opened = 0, whole = 0, watched = 0, ended = 0, closed = 0, finished = 0;
  std::uint64_t samples_made = 0, samples_sent = 0, samples_acked = 0;
  std::string trouble;  ///< of one station that has any
};

/// Every `of`-th station, starting with `first`. Thread: the owner's; its own for the network.
class StationThread {
 public:
  StationThread(LoadShared& shared, std::size_t first, std::size_t of);
  ~StationThread();

  /// Starts connecting them, this many per second.
  void connect(double per_s);
  /// Every station's plan must have its start_ns: streams until all have made all their ticks.
  void stream();
  /// Ends each with what it has made so far.
  void endNow();
  /// `station`: its number in the run; one of this thread's.
  void cut(std::size_t station);
  /// Adds the state of this thread's stations.
  void tell(CrowdState& state);
  void addTotals(StationTotals& totals);
  /// LoadStation::whole_ns of each that is whole.
  void tellWhole(std::vector<std::int64_t>& since_ns);
  /// Call after stop(): the number of samples that each station made, indexed by station of the run.
  void tellTicks(std::vector<std::uint64_t>& ticks) const;
  /// Closes all connections and ends the thread.
  void stop();

 private:
  Task<> connectAll(double per_s);
  Task<> schedule();
  LoadShared& shared_;
  const std::size_t first_, of_;
  NetThread net_;  // destroyed last: stations have timers on it; stop() has already ended its thread
  StationTotals totals_;
  bool end_now_ = false, stopping_ = false;
  std::vector<std::unique_ptr<LoadStation>> stations_;
  std::vector<bool> ended_;
};

// All stations of a run, on a few network threads.

/// Thread: the owner's.
class StationCrowd {
 public:
  /// Uses two threads: a single thread is limited to one core and would be late with a thousand stations'
  /// frames while the machine's other core is idle.
  explicit StationCrowd(LoadShared& shared, std::size_t threads = 2);

  /// Starts connecting them, this many per second.
  void connect(double per_s);
  /// Every station's plan must have its start_ns: streams until all have made all their ticks.
  void stream();
  /// Ends each with what it has made so far.
  void endNow();
  void cut(std::size_t station);
  [[nodiscard]] CrowdState state();
  [[nodiscard]] std::vector<std::int64_t> wholeSince_ns();
  /// Call after stop(): the number of samples that each station made.
  [[nodiscard]] std::vector<std::uint64_t> ticks() const;
  [[nodiscard]] StationTotals totals();
  /// Closes all connections and ends the threads.
  void stop();

 private:
  std::size_t stations_;
  std::vector<std::unique_ptr<StationThread>> threads_;
};

}  // namespace needlelab::test
