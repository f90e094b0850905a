/// A model's errors on held-out data, summed by unit.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/benchmark/fitted_model.h"
#include "client/sim/benchmark/training.h"
#include "client/sim/benchmark/verdict.h"
#include "common/base/result.h"

namespace needlelab {

/// A held-out bin: the measured value and the model's.
struct PredictedBin {
  double at = 0, value_N = 0, predicted_N = 0;
};
using PredictedBins = std::vector<PredictedBin>;

/// Returns the held-out bins of each curve in the fold; empty for curves that were fitted on. Errors: the
/// model's.
Result<std::vector<PredictedBins>> predictionsOf(const std::vector<BinnedCurve>& curves, const Fold& fold,
                                                 const FittedModel& model);
/// Returns the bins of a curve's hold (20 equal ones over time) or withdrawal; empty if it has none. Errors:
/// the model's; kInvalidInput for a model that only covers the insertion.
Result<PredictedBins> predictHoldOrWithdrawal(HoldOut what, const FittedModel& model,
                                              const ForceCurve& curve);

/// Bins before a depth, and the others.
std::pair<PredictedBins, PredictedBins> cutAt(const PredictedBins& bins, double at_m);

/// Least-squares factor between the model's forces and the measured ones, clamped to 0.2-5.
double factorOf(const PredictedBins& bins);

/// The unit of a curve: specimen × speed, and needle if needles are held out.
std::string unitOf(HoldOut what, const ForceCurve& curve);

/// Sums of a model in a unit.
struct UnitSum {
  double squares = 0;
  std::size_t bins = 0, inside = 0;
};

/// A model over all folds of a question.
struct Tally {
  std::string name, variant, fault;
  ModelKind kind = ModelKind::kEngine;
  std::size_t parameters = 0, folds = 0;
  double fit_error_N = 0, max_error_N = 0;
  std::map<std::string, UnitSum> units;

  void addFold(const FittedModel& model);
  /// Adds errors of `factor` × the model's forces. A trivial baseline uses the factor only if that is better
  /// on these bins, because it is what must be beaten. `limits`: the band, if asked.
  void add(const std::string& unit, const PredictedBins& bins, double factor = 1,
           const std::function<ForceLimits(double depth_m, double force_N)>& limits = {});
};

/// Fills all of a row that a tally provides. The tally must have a unit.
BenchmarkRow rowOf(HoldOut what, const Tally& tally);

}  // namespace needlelab
