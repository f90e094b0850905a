/// The needle benchmark: models and laws against any set of force curves, judged on what they were not fitted
/// on: which are not worse than the best by more than a margin, and better than no law at all.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/benchmark/fitted_model.h"
#include "client/sim/benchmark/training.h"
#include "common/base/range.h"
#include "common/base/result.h"

namespace needlelab {

/// Fewer units, or fewer specimens (needles, speeds) held out, tell nothing about others of their kind.
inline constexpr std::size_t kLeastUnits = 3;
inline constexpr NumberRange kMargin{0.01, 0.5}, kCalibration_m{0.001, 0.05};
inline constexpr std::size_t kMostBenchmarkNumbers = 100;

struct BenchmarkOptions {
  std::size_t most_numbers = kEqualNumbers;  ///< of a model, kLeastNumbers to kMostBenchmarkNumbers
  /// What is as good, as a share of the held-out rms force, kMargin. A tenth: of a force at a hand, a
  /// difference of 7 to 10 % is just felt (Pang, Tan and Durlach 1991; Jones 1989).
  double margin = 0.1;
  double calibration_m = 0.005;    ///< depth to which specimen-start calibrates, kCalibration_m
  bool times = true;               ///< false: no tick is timed, so that all output is repeatable
  std::vector<HoldOut> questions;  ///< only these; empty: all of kHoldOuts
};

/// What a model's result says, by 95 % intervals of paired differences over units (verdict.h).
enum class BenchmarkVerdict : std::uint8_t {
  kNone,        ///< no model, or a question without a verdict (blocks)
  kNamed,       ///< beats the trivial by more than the margin, and is not worse than the best by more
  kInferior,    ///< worse than the best by more than the margin
  kTrivial,     ///< does not beat the trivial by more than the margin
  kCannotTell,  ///< none of these, or fewer than kLeastUnits units
};
/// "", "named", "worse than the best", "no better than trivial", "cannot tell".
std::string_view nameOf(BenchmarkVerdict verdict);

/// A mean of paired differences over units, with its 95 % interval from two units on. Not corrected for how
/// many models there are: the margin stands in for that.
struct PairedDifference {
  double mean_N = 0;
  std::optional<double> low_N, high_N;
};

/// One model in one question.
struct BenchmarkRow {
  HoldOut what = HoldOut::kBlocks;
  std::string model, variant;
  ModelKind kind = ModelKind::kEngine;
  std::size_t place = 0;       ///< in the order of fitModels
  std::size_t parameters = 0;  ///< the most in any fold
  std::size_t units = 0;       ///< specimen × speed (× needle, where needles are held out)
  double error_N = 0;          ///< mean over units of their rms error on held-out bins
  std::optional<double> error_low_N, error_high_N;  ///< its 95 % interval, from two units on
  double max_error_N = 0;                           ///< of a bin
  double fit_error_N = 0;                           ///< rms on what it was fitted on, mean over folds
  std::optional<PairedDifference> beats;   ///< error of the best trivial baseline − error; above 0: better
  std::optional<PairedDifference> behind;  ///< error − that of the best; above 0: worse
  BenchmarkVerdict verdict = BenchmarkVerdict::kNone;
  std::optional<double> in_band;         ///< share of held-out bins within the model's 95 % band, where asked
  std::string band;                      ///< the verdict about the band, as text; empty: not asked
  std::optional<double> median_ns;       ///< of a tick, hot; of the engine's
  std::optional<double> energy_given_J;  ///< of the engine's
  std::vector<double> unit_errors_N;     ///< in the order of the question's units
};

struct QuestionResult {
  HoldOut what = HoldOut::kBlocks;
  std::vector<std::string> units;  ///< their names
  std::size_t held_out = 0;        ///< specimens (needles, speeds) that were held out
  std::vector<BenchmarkRow> rows;  ///< in the order of fitModels
  double margin_N = 0;             ///< the share × the units' mean rms force
  std::string text;                ///< a paragraph
  /// Of the models and laws with least error; null: no rows.
  [[nodiscard]] const BenchmarkRow* best() const;
  /// The named ones, least error first.
  [[nodiscard]] std::vector<const BenchmarkRow*> named() const;
};

struct BenchmarkReport {
  std::string data, licence, source;  ///< of the set
  std::size_t curves = 0, tissues = 0, specimens = 0, needles = 0, speeds = 0;
  std::size_t most_numbers = 0;
  double margin = 0, calibration_m = 0;
  std::vector<QuestionResult> questions;  ///< those that the data can be asked
  std::vector<std::string> notes;         ///< of the set, and what was not asked
  std::string conclusion;  ///< what is named for what, that no law is, or that the data cannot tell
};

/// Called now and then with what is done and the share that is done (0-1).
using BenchmarkProgress = std::function<void(std::string_view doing, double share)>;

/// Deterministic but for `median_ns`. Thread: one. Errors: kInvalidInput for options out of range.
Result<BenchmarkReport> runBenchmark(const CurveSet& set, const BenchmarkOptions& options,
                                     const BenchmarkProgress& progress = {});

}  // namespace needlelab
