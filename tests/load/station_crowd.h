/// All stations of a run, on a few network threads.
#pragma once

#include <memory>
#include <vector>

#include "tests/load/station_thread.h"

namespace needlelab::test {

/// Thread: the owner's.
class StationCrowd {
 public:
  /// Two threads: one alone would make a thousand stations' frames in the time of one core, and be late with
  /// them, while the machine's other core has time left.
  explicit StationCrowd(LoadShared& shared, std::size_t threads = 2);

  /// Begins to connect them, so many a second.
  void connect(double per_s);
  /// Every station's plan has its start_ns: streams until all have made all their ticks.
  void stream();
  /// Each ends with what it has made.
  void endNow();
  void cut(std::size_t station);
  [[nodiscard]] CrowdState state();
  /// After stop(): how many samples each has made.
  [[nodiscard]] std::vector<std::uint64_t> ticks() const;
  [[nodiscard]] StationTotals totals();
  /// Closes all connections and ends the threads.
  void stop();

 private:
  std::size_t stations_;
  std::vector<std::unique_ptr<StationThread>> threads_;
};

}  // namespace needlelab::test
