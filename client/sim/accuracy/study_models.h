/// The compared models, at equal stiffness, and the cost of a tick of each.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "client/sim/accuracy/study.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

inline constexpr double kStationRate_hz = 1000, kStationEncoder_m = 1e-5;
/// Compared numbers of FEM stations: the tick's cost depends on them, not on the mesh.
inline constexpr int kStationCounts[] = {15, 30, 60};

/// A scene rendered by one of the models.
struct StudyModel {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;  ///< empty for the default
  SceneSpec spec;       ///< like for like; FEM: with its compliance
  int stations = 0;     ///< of FEM
};

/// The paper's six layers.
Result<SceneSpec> studyScene();

/// All axial models at the stiffness of the scene's walls (likeForLike, femLikeForLike); VOIGT also with a
/// velocity over an adaptive window; FEM with each number of kStationCounts on a mesh of about `fem_nodes`.
/// Errors: as femLikeForLike.
Result<std::vector<StudyModel>> studyModels(const SceneSpec& scene, int fem_nodes = 3000);

/// Force along the trajectory: sum of cutting, attracted, friction and puncture.
double axialForce_N(const StepReport& report);

/// Cost of a model, the same in all comparators.
struct ModelCost {
  std::string model, variant;
  int stations = 0;
  std::optional<LoopTimes> time;
  std::optional<double> instructions;
  double margin = 0;
};

/// Times a tick in the station's own loop (ServoLoop with the simulated device and hand, at 1 kHz and normal
/// priority), in three rounds of `seconds` in turns: p50 to p99.9 of its histogram of tool, gate and engine,
/// each the median of the rounds. Margin: `b/(T(½ + delay))/K`, with the device's own damping and the model's
/// stiffness along the needle (FORCE_MODEL.md, "Sum and cap"). Thread: starts one. Errors: those of
/// `compile`; kFailed if the loop ended early.
Result<std::vector<ModelCost>> measureCosts(double seconds, const AccuracyProgress& progress);

/// Counts the instructions of a tick of each model over one gesture. `command` must be a program that calls
/// `stepForCounting`. Errors: as countStepInstructions.
Status countInstructions(const std::vector<std::string>& command, std::vector<ModelCost>& costs);
/// Steps every model through the gesture, and marks the end of each (instruction_count.h).
Status stepForCounting();

/// Adds each model's cost to its rows: only models (no baselines), at the station's rate.
void addCosts(const std::vector<ModelCost>& costs, AccuracyRows& rows);

}  // namespace needlelab
