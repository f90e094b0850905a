/// The benchmark's result, and the rule for naming models.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/benchmark/fitted_model.h"
#include "client/sim/benchmark/training.h"

namespace needlelab {

/// Fewer units, or fewer held-out specimens (needles, speeds), do not generalise.
inline constexpr std::size_t kMinUnits = 3;

/// Meaning of a model's result, from 95 % intervals of paired differences over units (`decide`).
enum class BenchmarkVerdict : std::uint8_t {
  kNone,       ///< not a model, or a question without a verdict (blocks)
  kNamed,      ///< beats the trivial baseline by more than the margin, and is not worse than the best by
               ///< more than that
  kInferior,   ///< worse than the best by more than the margin
  kTrivial,    ///< does not beat the trivial baseline by more than the margin
  kUndecided,  ///< none of these, or fewer than kMinUnits units
};
/// "", "named", "worse than the best", "no better than trivial", "cannot tell".
std::string_view nameOf(BenchmarkVerdict verdict);

/// A mean of paired differences over units, with its 95 % interval for two or more units. Not corrected for
/// the number of models: the margin compensates for that.
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
  std::size_t parameters = 0;  ///< the maximum over the folds
  std::size_t units = 0;       ///< specimen × speed (× needle, if needles are held out)
  double error_N = 0;          ///< mean over units of their RMS error on held-out bins
  std::optional<double> error_low_N, error_high_N;  ///< its 95 % interval, for two or more units
  double max_error_N = 0;                           ///< of a single bin
  double fit_error_N = 0;                           ///< RMS on the data that it was fitted on, mean over
                                                    ///< folds
  std::optional<PairedDifference> beats;   ///< error of the best trivial baseline − error; above 0: better
  std::optional<PairedDifference> behind;  ///< error − the best model's; above 0: worse
  BenchmarkVerdict verdict = BenchmarkVerdict::kNone;
  std::optional<double> in_band;         ///< share of held-out bins within the model's 95 % band, if asked
  std::string band;                      ///< verdict about the band, as text; empty if not asked
  std::optional<double> median_ns;       ///< of a hot tick; engine models only
  std::optional<double> energy_given_J;  ///< engine models only
  std::vector<double> unit_errors_N;     ///< in the order of the question's units
};

struct QuestionResult {
  HoldOut what = HoldOut::kBlocks;
  std::vector<std::string> units;  ///< their names
  std::size_t held_out = 0;        ///< number of held-out specimens (needles, speeds)
  std::vector<BenchmarkRow> rows;  ///< in the order of fitModels
  double margin_N = 0;             ///< share × mean RMS force of the units
  std::string text;                ///< a paragraph
  /// The model or law with the smallest error; null without rows.
  [[nodiscard]] const BenchmarkRow* best() const;
  /// The named ones, smallest error first.
  [[nodiscard]] std::vector<const BenchmarkRow*> named() const;
};

struct BenchmarkReport {
  std::string data, licence, source;  ///< of the set
  std::size_t curves = 0, tissues = 0, specimens = 0, needles = 0, speeds = 0;
  std::size_t max_numbers = 0;
  double margin = 0, calibration_m = 0;
  std::vector<QuestionResult> questions;  ///< those that the data can answer
  std::vector<std::string> notes;         ///< of the set, and which questions were not asked
  std::string conclusion;  ///< what is named for what, or that no law is, or that the data cannot tell
};

/// Fills the question's margin, differences, verdicts and text from its rows' errors.
/// - The margin is `share` of the held-out RMS force, which is the error of NO_FORCE.
/// - The trivial baseline is the one with the smallest error, the best is the model with the smallest error.
///   CONNECT_THE_DOTS has a number for each bin: it is the noise floor and does not take part.
/// - A model is named if, over units, the 95 % interval of its gain over the trivial baseline lies above the
///   margin, and that of its loss to the best does not reach above the margin (non-inferiority).
/// - It is rejected if the gain's interval lies below the margin, or the loss's above it. Otherwise the data
///   cannot tell.
void decide(QuestionResult& question, double share);

/// Which models are named for what, over all questions that predict.
std::string conclusionOf(const BenchmarkReport& report);

}  // namespace needlelab
