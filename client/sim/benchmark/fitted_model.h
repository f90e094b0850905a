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
  kBaseline,  ///< no model: the data themselves
  kFormula,   ///< a fitted law that the engine does not have
  kEngine,    ///< a model of the engine, run through it
};
/// "baseline", "formula", "engine".
std::string_view nameOf(ModelKind kind);

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
  std::function<ForceLimits(double depth_m, double force_N)> limits;  ///< of a force that it said
  std::optional<CurveScene> scene;                                    ///< of the engine's
  std::string fault;  ///< why it could not be fitted; empty: it was. Then nothing above but the name counts
};

using FitProgress = std::function<void(std::string_view model)>;

/// All models, each with at most `most_numbers` (at least kLeastNumbers) but for the baselines: both
/// baselines, both formulas, the engine's models in the order of curveModels, STATISTICAL. The engine's know
/// no diameter, and only VOIGT, OKAMURA and DAHL a speed. Always the same models in the same order.
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
