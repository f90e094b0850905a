/// Baselines, laws and the engine's models, fitted to a training set, ready to say the force of an insertion
/// that they have not seen.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/benchmark/training.h"
#include "common/base/result.h"

namespace needlelab {

enum class ModelKind : std::uint8_t {
  kFloor,    ///< the data themselves, every bin of them: the noise floor, no competitor
  kTrivial,  ///< one number or none: what a law must beat
  kFormula,  ///< a fitted law that the engine does not have
  kEngine,   ///< a model of the engine, run through it
};
/// "noise floor", "trivial", "formula", "engine".
std::string_view nameOf(ModelKind kind);
constexpr bool isModel(ModelKind kind) {
  return kind == ModelKind::kFormula || kind == ModelKind::kEngine;
}

/// What a model says of the phases behind an insertion.
struct Afterwards {
  std::vector<double> hold_N;  ///< at each time of the curve's hold
  std::vector<double> out_N;   ///< at each depth of its withdrawal
};

/// The limits within which a model expects 95 % of the bins.
struct ForceLimits {
  double low_N = 0, high_N = 0;
};

struct FittedModel {
  std::string name, variant;
  ModelKind kind = ModelKind::kEngine;
  std::size_t parameters = 0;
  /// rms over the single curves' bins that it was fitted on.
  double fit_error_N = 0;
  /// The same, for as many numbers as were fitted: the root of the squares over (bins − numbers). 0: as many
  /// numbers as bins.
  double spread_N = 0;
  /// At each depth, ascending. Errors: those of `compile`.
  std::function<Result<std::vector<double>>(const InsertionKind& kind, const std::vector<double>& depth_m)>
      forces;
  /// Of a whole curve, whose forces it does not look at; null: the model knows the way in only.
  std::function<Result<Afterwards>(const ForceCurve& curve)> afterwards;
  std::function<ForceLimits(double depth_m, double force_N)> limits;  ///< of a force that it said
  std::optional<CurveScene> scene;                                    ///< of the engine's
  std::string fault;  ///< why it could not be fitted; empty: it was. Then nothing above but the name counts
};

using FitProgress = std::function<void(std::string_view model)>;

/// All models, each with at most `most_numbers` (at least kLeastNumbers) but for CONNECT_THE_DOTS, which
/// joins all bins: CONNECT_THE_DOTS, HOLD_THE_LAST (the last bin's force everywhere), MEAN_FORCE, NO_FORCE,
/// both formulas, the engine's models in the order of curveModels, STATISTICAL. The engine's know no
/// diameter, and only VOIGT, OKAMURA and DAHL a speed. Always the same models in the same order.
/// Deterministic. Errors: kInvalidInput for an empty set.
Result<std::vector<FittedModel>> fitModels(const TrainingSet& training, std::size_t most_numbers,
                                           const FitProgress& progress);

/// Energy that a scene gives to the hand at the worst moment of a prescribed motion, in J: in to a third, two
/// thirds and all of `to_m`, 20 mm/s, each time with three strokes of 1 mm back and forth, and out. 0 is
/// passive; stability's limit is 50 µJ (PassivityLimits). Errors: those of `compile`.
Result<double> energyGiven_J(const CurveScene& scene, double to_m);

/// Median time of the engine's tick along the insertion, in ns. Hot.
Result<double> tickTime_ns(const CurveScene& scene, double to_m);

}  // namespace needlelab
