#include "client/sim/accuracy/study_models.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "client/effect_cost/instruction_count.h"
#include "client/sim/accuracy/gesture.h"
#include "common/fem/needle_mesh.h"
#include "common/fem/needle_study.h"

namespace needlelab {
namespace {

constexpr double kEncoder_m = 1e-5;  // of the simulated device: what the adaptive window bridges
constexpr double kCountedRate_hz = 1000;
constexpr int kCoarseNodes = 500;

}  // namespace

std::vector<StudyModel> studyModels(const SceneSpec& scene) {
  std::vector<StudyModel> models;
  for (std::size_t m = 0; m < kAxialModelCount; ++m) {
    const auto model = static_cast<AxialModel>(m);
    models.push_back({model, {}, likeForLike(scene, model)});
    if (model != AxialModel::kVoigt) continue;
    models.push_back({model, "velocity over an adaptive window", models.back().spec});
    models.back().spec.voigt.velocity_noise_m = kEncoder_m;
  }
  return models;
}

Status addMesh(StudyModel& study, const SceneSpec& scene, int nodes) {
  if (study.model != AxialModel::kFem) return {};
  ASSIGN_OR_RETURN(auto fem, femLikeForLike(scene, nodes));
  study.spec = std::move(fem.spec);
  study.young_factor = fem.young_factor;
  return addCompliance(study.spec);
}

std::string assumptionRemark(const StudyModel& study, const SceneSpec& scene) {
  const std::string text = frictionAssumption(scene, study.model);
  return text.empty() ? text : ". " + text;
}

std::string elasticityText(double young_factor) {
  return fmt::format(
      "an elasticity that was set, not measured: the scene's lateral stiffness gives E, times {:.3g} in all "
      "layers, so that the tip meets the stiffness of the scene's walls at the skin",
      young_factor);
}

bool profileHasLawOf(AxialModel model) {
  constexpr std::array kByTheWall = {AxialModel::kEnhancedTrackingWall, AxialModel::kTrackingWall,
                                     AxialModel::kStatistical, AxialModel::kPrecomputed};
  return std::find(kByTheWall.begin(), kByTheWall.end(), model) != kByTheWall.end();
}

std::string choiceOf(const StudyModel& model) {
  const std::string name(axialModelName(model.model));
  return model.variant.empty() ? name : name + ", " + model.variant;
}

Result<std::vector<CountedTick>> countStudyTicks(const std::vector<std::string>& command) {
  ASSIGN_OR_RETURN(const auto scenes, studyScenes());
  std::vector<CountedTick> counted;
  std::vector<std::size_t> ticks;
  for (const StudyScene& scene : scenes)
    for (const StudyModel& model : studyModels(scene.spec)) {
      counted.push_back({scene.name, choiceOf(model)});
      ticks.push_back(studyGesture(scene.spec, 1, kCountedRate_hz).tips.size());
    }
  ASSIGN_OR_RETURN(const auto counts, countStepInstructions(command, counted.size()));
  for (std::size_t i = 0; i < counted.size(); ++i)
    counted[i].instructions = static_cast<double>(counts[i]) / static_cast<double>(ticks[i]);
  return counted;
}

Status stepForCounting() {
  ASSIGN_OR_RETURN(const auto scenes, studyScenes());
  for (const StudyScene& scene : scenes) {
    const StudyGesture gesture = studyGesture(scene.spec, 1, kCountedRate_hz);
    for (StudyModel& model : studyModels(scene.spec)) {
      RETURN_IF_ERROR(addMesh(model, scene.spec, kCoarseNodes));
      ASSIGN_OR_RETURN(const auto compiled, compile(model.spec, kCountedRate_hz));
      const TimedTick timed = timedSteps(compiled, gesture);
      for (std::size_t i = 0; i < gesture.tips.size(); ++i) timed.tick();
      endCountedPart();
    }
  }
  return {};
}

std::optional<double> instructionsOf(const AccuracyOptions& options, std::string_view scene,
                                     const StudyModel& model) {
  const auto at =
      std::find_if(options.counted.begin(), options.counted.end(), [&](const CountedTick& counted) {
        return counted.scene == scene && counted.choice == choiceOf(model);
      });
  if (at == options.counted.end()) return std::nullopt;
  return at->instructions;
}

}  // namespace needlelab
