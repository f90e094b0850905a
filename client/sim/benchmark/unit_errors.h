/// A model's errors on what was held out, added up by unit.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/benchmark/benchmark.h"
#include "client/sim/benchmark/fitted_model.h"
#include "client/sim/benchmark/training.h"
#include "common/base/result.h"

namespace needlelab {

/// A held-out bin: what was measured there, and what a model says.
struct SaidBin {
  double at = 0, value_N = 0, said_N = 0;
};
using SaidBins = std::vector<SaidBin>;

/// At the held-out bins of each of the fold's curves; none of a curve that was fitted on. Errors: the
/// model's.
Result<std::vector<SaidBins>> saidOf(const std::vector<BinnedCurve>& curves, const Fold& fold,
                                     const FittedModel& model);
/// At the bins of a curve's hold (20 equal ones in time) or withdrawal; none where it has none. Errors: the
/// model's; kInvalidInput for a model that knows the way in only.
Result<SaidBins> saidAfterwards(HoldOut what, const FittedModel& model, const ForceCurve& curve);

/// Those before a depth, and the others.
std::pair<SaidBins, SaidBins> cutAt(const SaidBins& bins, double at_m);

/// The factor by which the model's forces come closest to the measured ones, by least squares; 0.2 to 5.
double factorOf(const SaidBins& bins);

/// Who answers for a curve: specimen × speed, and needle where needles are held out.
std::string unitOf(HoldOut what, const ForceCurve& curve);

/// What is added up of a model in a unit.
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
  /// Errors of `factor` × the model's forces, but for a trivial baseline, which has the factor or not, by
  /// what is better on these bins: it is what must be beaten. `limits`: the band, where that is asked.
  void add(const std::string& unit, const SaidBins& bins, double factor = 1,
           const std::function<ForceLimits(double depth_m, double force_N)>& limits = {});
};

/// All of a row that a tally knows. The tally has a unit.
BenchmarkRow rowOf(HoldOut what, const Tally& tally);

}  // namespace needlelab
