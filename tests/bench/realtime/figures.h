/// What a run measured: named figures with unit. tests/bench/realtime/run adds ratios and the comparison.
#pragma once

#include <string>
#include <vector>

#include "common/base/histogram.h"
#include "common/base/result.h"
#include "tests/bench/realtime/loop_slices.h"

namespace needlelab::test {

/// Which figure of cyclictest and of the plain loop a figure is divided by.
enum class Beside { kRate, kMedian, kP99, kP999, kMax, kOnTime };

struct Figure {
  std::string name;
  std::string unit;  ///< "µs", "ns", "ms", "Hz", "%", "1/s"
  double value = 0;
  Beside beside = Beside::kMedian;
};
using Figures = std::vector<Figure>;

/// Rate, quantiles and punctuality of one side's wake-ups.
void addWakeups(Figures& figures, const std::string& side, const Wakeups& wakeups);
/// Median and p99 in µs.
void addQuantiles(Figures& figures, const std::string& name, const LatencyHistogram& durations);
/// The haptic loop's tick beyond its wake-ups.
void addLoop(Figures& figures, const SliceResult& slices);

/// A tick of the engine with several sets of effects, and what watching the loop costs.
void addEngine(Figures& figures);
/// Commits of stations' chunks, alone and beside a run of retention that thins recordings of a minute, and
/// how long that run takes for each of them. Errors: the database.
Status addRetention(Figures& figures, double seconds);

/// Stations' acknowledgements and a viewer's frames on a server in this process: alone, and beside 100
/// viewers that do not read.
void addViewers(Figures& figures, double seconds);

/// {"figures": [{"name", "unit", "value", "beside"}]}, and what `more` holds (JSON members, or empty).
std::string figuresJson(const Figures& figures, const std::string& more = {});

}  // namespace needlelab::test
