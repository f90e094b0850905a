/// The real haptic loop and cyclictest, slice by slice in turn, so that a slow moment of the machine falls on
/// both.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/real_time.h"
#include "common/base/histogram.h"
#include "common/base/result.h"

namespace needlelab::test {

struct LoopBenchOptions {
  double seconds = 60;  ///< of each of the two
  double slice_s = 10;  ///< a whole number of slices is run: at least one
  double rate_hz = 1000;
  int priority = 80;
  std::optional<int> cpu;    ///< for both
  std::int64_t spin_ns = 0;  ///< the loop's; cyclictest has none
};

/// The wake-ups of one side.
struct Wakeups {
  LatencyHistogram late;  ///< after the time that each was due
  std::uint64_t count = 0;
  std::uint64_t over_T = 0;  ///< late by a period or more
  /// Share late by a period or more.
  [[nodiscard]] double shareOverT() const {
    return count == 0 ? 0 : static_cast<double>(over_T) / static_cast<double>(count);
  }
  void add(const Wakeups& other) {
    late.add(other.late);
    count += other.count;
    over_T += other.over_T;
  }
};

/// One slice of each, in the order in which they ran.
struct SlicePair {
  bool loop_first = true;
  Wakeups loop, cyclictest;
};

struct LoopBenchResult {
  LoopBenchOptions options;
  Wakeups loop, cyclictest;
  LatencyHistogram tick;  ///< the loop's work
  std::uint64_t missed_ticks = 0;
  std::vector<SlicePair> slices;
  std::vector<RtStep> realtime;  ///< of the loop's thread in the last slice
};

/// One slice of cyclictest (rt-tests): same priority, interval and memory lock; it also keeps the cores out
/// of deep sleep. Its histogram has buckets of 1 µs, each counted at its middle. Errors: kUnavailable when
/// cyclictest is missing or may not run at this priority.
Result<Wakeups> runCyclictest(const LoopBenchOptions& options);

/// All slices. `progress` is called before each. Errors: kUnavailable, also when FIFO is not permitted,
/// because the comparison would be meaningless.
Result<LoopBenchResult> runLoopBench(const LoopBenchOptions& options,
                                     const std::function<void(const std::string&)>& progress);

}  // namespace needlelab::test
