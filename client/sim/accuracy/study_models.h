/// The models that the studies compare, and the instructions that a tick of each takes.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/accuracy/study.h"
#include "common/base/result.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// A scene rendered by one of the models.
struct StudyModel {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;      ///< empty for the model as it ships
  SceneSpec spec;           ///< like for like; FEM before addMesh
  double young_factor = 1;  ///< of FEM (FemScene)
};

/// Every axial model, and VOIGT a second time with a velocity over an adaptive window.
std::vector<StudyModel> studyModels(const SceneSpec& scene);

/// Makes FEM as stiff as the scene's walls (femLikeForLike) on a mesh of about `nodes`, with its compliance;
/// other models stay as they are. `scene`: that of `studyModels`. Errors: as femLikeForLike, addCompliance.
Status addMesh(StudyModel& study, const SceneSpec& scene, int nodes = kDefaultFemNodes);

/// What of a row's model was assumed, for `cannot_show`: ". Static friction of …", or empty.
std::string assumptionRemark(const StudyModel& study, const SceneSpec& scene);

/// Where FEM's elasticity comes from, as a part of a sentence of `cannot_show`: "an elasticity that was set
/// …".
std::string elasticityText(double young_factor);

/// True if the scene's own force profile contains the model's law: those that the tracking wall renders share
/// its stop, its attracted force, or a table made of it.
bool profileHasLawOf(AxialModel model);

/// ENHANCED_TRACKING_WALL, or "VOIGT, velocity over an adaptive window": the key of `CountedTick::choice`.
std::string choiceOf(const StudyModel& model);

/// Counts the instructions of a tick of each model over the study's first gesture in each scene: `command`
/// must be a program that calls `stepForCounting`. FEM has a coarse mesh there, because its tick depends on
/// the needle's stations alone. Takes about half a minute. Errors: as countStepInstructions.
Result<std::vector<CountedTick>> countStudyTicks(const std::vector<std::string>& command);

/// Steps every model through its gesture, with a mark behind each (instruction_count.h). Errors: as
/// `compile`.
Status stepForCounting();

/// The count of a model in a scene; empty when it was not counted.
std::optional<double> instructionsOf(const AccuracyOptions& options, std::string_view scene,
                                     const StudyModel& model);

}  // namespace needlelab
