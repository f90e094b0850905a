/// What a tick costs as the station pays it: single ticks, each timed alone, hot, with flushed caches and
/// after a millisecond of sleep, beside an empty call that is timed the same way.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace needlelab {

/// Of single ticks, in ns, the reading of the clock included.
struct TickQuantiles {
  double p50_ns = 0, p99_ns = 0, p999_ns = 0;
};

/// Quantile q is the least value such that at least the share q of all values is not above it. Zeros for no
/// values.
TickQuantiles quantilesOf(std::vector<double> single_ns);

/// A cost with the noise of its runs.
struct CostInterval {
  double value = 0;          ///< median of the runs
  double low = 0, high = 0;  ///< of the least and of the greatest run
};

/// From one value of each run. Zeros for no runs.
CostInterval intervalOf(std::vector<double> runs);

/// Single durations of one run, in ns.
struct SingleTicks {
  std::vector<double> hot_ns, flushed_ns, slept_ns;
};

struct TickCost {
  /// With flushed caches: p50 less the empty call's of the same run. This is the price of a tick: a station
  /// sleeps between its ticks, and other programs use the caches.
  CostInterval cost_ns;
  TickQuantiles hot, flushed, slept;  ///< over all runs
  TickQuantiles hot_empty, flushed_empty, slept_empty;
  /// The tail that must fit into a period: a run's p99.9 of hot ticks or of ticks after a sleep, whichever is
  /// greater; the median of the runs, so that one disturbed run decides nothing.
  double tail_ns = 0;
  std::size_t runs = 0;
  std::size_t hot_count = 0, flushed_count = 0, slept_count = 0;  ///< ticks in all runs
};

/// From `runs` and as many runs of the empty call, taken in turns.
TickCost tickCostOf(const std::vector<SingleTicks>& runs, const std::vector<SingleTicks>& empty);

/// A tick to be timed.
struct TimedTick {
  std::function<void()> tick;
  std::size_t period = 1;  ///< ticks of its gesture: those that are timed are spread over all of it
};

/// How much is measured, in each of the runs.
struct CostEffort {
  std::size_t runs = 5;
  std::size_t hot = 2000, flushed = 21, slept = 200;
};

/// Measures all `ticks` in turns, an empty call among them, so that a slow moment of the machine meets all.
/// Between flushed ticks it reads a buffer larger than the last cache. `done` (may be empty) gets the share
/// that is done. Thread: any; run it alone on its core.
std::vector<TickCost> measureTicks(const std::vector<TimedTick>& ticks, const CostEffort& effort,
                                   const std::function<void(double share)>& done = {});

/// "time: 5 runs of 2,000 hot ticks, 21 with flushed caches (40 MiB read), 200 after 1 ms": for a row's
/// uncertainty.
std::string costText(const TickCost& cost);

}  // namespace needlelab
