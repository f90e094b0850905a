/// The needle benchmark: models and laws against any set of force curves, judged on what they were not fitted
/// on, beside baselines.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/benchmark/fitted_model.h"
#include "client/sim/benchmark/training.h"
#include "common/base/result.h"

namespace needlelab {

inline constexpr std::size_t kLeastUnits = 3;  ///< fewer tell nothing about others of their kind

struct BenchmarkOptions {
  std::size_t most_numbers = kEqualNumbers;  ///< of a model, kLeastNumbers to kMostBenchmarkNumbers
  bool times = true;                         ///< false: no tick is timed, so that all output is repeatable
  std::vector<HoldOut> questions;            ///< only these; empty: all of kHoldOuts
};
inline constexpr std::size_t kMostBenchmarkNumbers = 100;

/// What a model's result says. "predicts" and "worse" compare with the better baseline, over units.
enum class BenchmarkVerdict : std::uint8_t {
  kBaseline,
  kPredicts,    ///< less error than the better baseline, Holm's p at most 0.05
  kWorse,       ///< more, likewise
  kCannotTell,  ///< neither, or fewer than kLeastUnits units
  kFits,        ///< the question asks for no prediction (blocks): no verdict
};
/// "baseline", "predicts", "worse than a baseline", "cannot tell", "fits only".
std::string_view nameOf(BenchmarkVerdict verdict);

/// One model in one question.
struct BenchmarkRow {
  HoldOut what = HoldOut::kBlocks;
  std::string model, variant;
  ModelKind kind = ModelKind::kEngine;
  std::size_t parameters = 0;  ///< the most in any fold
  std::size_t units = 0;  ///< specimens, needles, speeds; curves for end and blocks, halves of a single one
  double error_N = 0;     ///< mean over units of their rms error on held-out bins
  std::optional<double> error_low_N, error_high_N;  ///< its 95 % interval, from two units on
  double max_error_N = 0;                           ///< of a bin
  double fit_error_N = 0;                           ///< rms on what it was fitted on, mean over folds
  std::optional<double> better_N;  ///< error of the better baseline − error, mean over units; above 0: better
  std::optional<double> better_low_N, better_high_N;  ///< its 95 % interval, uncorrected
  std::optional<double> p;  ///< of the errors' ratio being 1; by Holm, where units tell
  BenchmarkVerdict verdict = BenchmarkVerdict::kFits;
  double in_band = 0;                    ///< share of held-out bins within the model's 95 % band
  std::string band;                      ///< the verdict about the band, as text
  std::optional<double> median_ns;       ///< of a tick, hot; of the engine's
  std::optional<double> energy_given_J;  ///< of the engine's
  std::vector<double> unit_errors_N;     ///< in the order of the question's units
};

struct QuestionResult {
  HoldOut what = HoldOut::kBlocks;
  std::vector<std::string> units;  ///< their names
  std::vector<BenchmarkRow> rows;  ///< in the order of fitModels
  std::string text;                ///< a paragraph
  /// Of the models and laws (no baseline) with least error; null: no rows.
  [[nodiscard]] const BenchmarkRow* best() const;
};

struct BenchmarkReport {
  std::string data, licence, source;  ///< of the set
  std::size_t curves = 0, tissues = 0, specimens = 0, needles = 0, speeds = 0;
  std::size_t most_numbers = 0;
  std::vector<QuestionResult> questions;  ///< those that the data can be asked
  std::vector<std::string> notes;         ///< of the set, and what was not asked
  std::string conclusion;  ///< which model predicts rather than fits, or that the data cannot tell
};

/// Called now and then with what is done and the share that is done (0-1).
using BenchmarkProgress = std::function<void(std::string_view doing, double share)>;

/// Deterministic but for `median_ns`. Thread: one. Errors: kInvalidInput for options out of range.
Result<BenchmarkReport> runBenchmark(const CurveSet& set, const BenchmarkOptions& options,
                                     const BenchmarkProgress& progress = {});

}  // namespace needlelab
