/// The haptic loop, cyclictest and a plain loop without work, slice by slice in turn, so that a slow moment
/// of the machine falls on all of them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/loop/real_time.h"
#include "common/base/histogram.h"
#include "common/base/result.h"

namespace needlelab::test {

struct SliceOptions {
  double seconds = 60;  ///< of each of the three
  double slice_s = 10;  ///< a whole number of slices is run: at least one
  double rate_hz = 1000;
  int priority = 80;         ///< SCHED_FIFO for all; 0: ordinary threads
  std::optional<int> cpu;    ///< for all
  std::int64_t spin_ns = 0;  ///< the haptic loop's; the others have none
};

/// The wake-ups of one side.
struct Wakeups {
  LatencyHistogram late;  ///< after the time that each was due
  std::uint64_t count = 0;
  std::uint64_t over_T = 0;  ///< late by a period or more
  double seconds = 0;        ///< that they took
  void add(const Wakeups& other) {
    late.add(other.late);
    count += other.count;
    over_T += other.over_T;
    seconds += other.seconds;
  }
};

struct SliceResult {
  Wakeups loop, plain;
  std::optional<Wakeups> cyclictest;  ///< nothing when it is not installed or may not run
  std::string cyclictest_trouble;
  LatencyHistogram tick;  ///< the haptic loop's work
  std::uint64_t missed_ticks = 0;
  std::uint64_t switches = 0;    ///< voluntary context switches of the process while the haptic loop ran
  std::vector<RtStep> realtime;  ///< of the loop's thread in the last slice
};

/// One slice of cyclictest (rt-tests): same priority, interval and memory lock; it also keeps the cores out
/// of deep sleep. Its histogram has buckets of 1 µs, each counted at its middle. Errors: kUnavailable when
/// cyclictest is missing or may not run at this priority.
Result<Wakeups> runCyclictest(const SliceOptions& options);

/// All slices. `progress` is called before each. Errors: the device, the scene or the spool could not be
/// made, or the loop ended early. A priority that is not permitted is not an error: SliceResult::realtime
/// says it.
Result<SliceResult> runSlices(const SliceOptions& options,
                              const std::function<void(const std::string&)>& progress);

}  // namespace needlelab::test
