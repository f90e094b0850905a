/// Baselines, laws and engine models, fitted to a training set, to predict the force of unseen insertions.
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
  kFloor,    ///< every bin of the data themselves: the noise floor, not a competitor
  kTrivial,  ///< one number or none: a law must beat it
  kFormula,  ///< a fitted law that the engine does not have
  kEngine,   ///< a model of the engine, run through it
};
/// "noise floor", "trivial", "formula", "engine".
std::string_view nameOf(ModelKind kind);
constexpr bool isModel(ModelKind kind) {
  return kind == ModelKind::kFormula || kind == ModelKind::kEngine;
}

/// A model's forces in the phases after an insertion.
struct Afterwards {
  std::vector<double> hold_N;  ///< at each time of the curve's hold
  std::vector<double> out_N;   ///< at each depth of its withdrawal
};

/// Range in which a model expects 95 % of the bins.
struct ForceLimits {
  double low_N = 0, high_N = 0;
};

struct FittedModel {
  std::string name, variant;
  ModelKind kind = ModelKind::kEngine;
  std::size_t parameters = 0;
  /// RMS over the single curves' bins that it was fitted on.
  double fit_error_N = 0;
  /// The same, corrected for the number of fitted parameters: root of the squares over (bins − numbers). 0 if
  /// there are as many numbers as bins.
  double spread_N = 0;
  /// At each depth, ascending. Errors: those of `compile`.
  std::function<Result<std::vector<double>>(const InsertionKind& kind, const std::vector<double>& depth_m)>
      forces;
  /// For a whole curve, without using its forces; null if the model only covers the insertion.
  std::function<Result<Afterwards>(const ForceCurve& curve)> afterwards;
  std::function<ForceLimits(double depth_m, double force_N)> limits;  ///< around a predicted force
  std::optional<CurveScene> scene;                                    ///< for engine models
  std::string fault;  ///< why it could not be fitted; empty if it was. If set, only the name is valid
};

using FitProgress = std::function<void(std::string_view model)>;

/// All models, each with at most `max_numbers` (at least kMinNumbers) except CONNECT_THE_DOTS, which joins
/// all bins: CONNECT_THE_DOTS, HOLD_THE_LAST (the last bin's force everywhere), MEAN_FORCE, NO_FORCE, both
/// formulas, the engine's models in the order of curveModels, STATISTICAL. The engine's models ignore the
/// diameter, and most of them the speed, too (`AxialEntry::feels_speed`). Always the same models in the same
/// order. Deterministic. Errors: kInvalidInput for an empty set.
Result<std::vector<FittedModel>> fitModels(const TrainingSet& training, std::size_t max_numbers,
                                           const FitProgress& progress);

/// Largest energy that a scene has given to the hand at any moment of a prescribed motion, in J: in to a
/// third, two thirds and all of `to_m` at 20 mm/s, each with three strokes of 1 mm back and forth, and out. 0
/// is passive; the stability limit is 50 µJ (PassivityLimits). Errors: those of `compile`.
Result<double> energyGiven_J(const CurveScene& scene, double to_m);

/// Median time of the engine's hot tick along the insertion, in ns.
Result<double> tickTime_ns(const CurveScene& scene, double to_m);

}  // namespace needlelab
