/// The needle benchmark: compares models and laws with any set of force curves, judged on held-out data.
/// Names those that are not worse than the best by more than a margin, and better than no law at all.
#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/benchmark/training.h"
#include "client/sim/benchmark/verdict.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/range.h"
#include "common/base/result.h"

namespace needlelab {

inline constexpr NumberRange kMargin{0.01, 0.5}, kCalibration_m{0.001, 0.05};
inline constexpr std::size_t kMaxBenchmarkNumbers = 100;

struct BenchmarkOptions {
  std::size_t max_numbers = kEqualNumbers;  ///< limit per model, kMinNumbers to kMaxBenchmarkNumbers
  /// Margin within which errors count as equal, as a share of the held-out RMS force, kMargin. A tenth: a
  /// hand just notices 7 to 10 % of a force (Pang, Tan and Durlach 1991; Jones 1989).
  double margin = 0.1;
  double calibration_m = 0.005;    ///< depth to which specimen-start calibrates, kCalibration_m
  bool times = true;               ///< false: ticks are not timed, so that all output is reproducible
  std::vector<HoldOut> questions;  ///< only these; empty: all of kHoldOuts
};

/// Called now and then with the current work and the finished share (0-1).
using BenchmarkProgress = std::function<void(std::string_view doing, double share)>;

/// Deterministic except `median_ns`. Thread: one. Errors: kInvalidInput for options out of range.
Result<BenchmarkReport> runBenchmark(const CurveSet& set, const BenchmarkOptions& options,
                                     const BenchmarkProgress& progress = {});

// --- the result as tables, CSV, JSON and picture data

/// The data, a table per question with its text below, the notes, the conclusion.
std::string benchmarkText(const BenchmarkReport& report);

/// One row per model and question, with the JSON's columns except `unit_errors_n`. Texts in double quotes.
std::string benchmarkCsv(const BenchmarkReport& report);

/// The rows, and the rest: `data`, `questions`, `notes`, `conclusion`.
nlohmann::ordered_json benchmarkRows(const BenchmarkReport& report);
nlohmann::ordered_json benchmarkRest(const BenchmarkReport& report);

/// Input of plots/benchmark.gp: the blocks in `data`, and the variables.
struct BenchmarkPicture {
  std::string data;
  std::vector<PlotVariable> variables;
};
BenchmarkPicture benchmarkPicture(const BenchmarkReport& report);

}  // namespace needlelab
