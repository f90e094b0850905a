/// ENHANCED_TRACKING_WALL: cutting and attracted force by the wall of FORCE_MODEL.md, "Tracking wall" (paper
/// eq. 1-6), and TRACKING_WALL, its predecessor of 2018: the same wall for insertion and stop, without
/// attracted force.
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/axial_entry.h"

namespace needlelab {
namespace {

constexpr StepTable kWallSteps = stepTable<LayeredWall>();

// every scene has this section, and `validate` checks it
void nothingToCheck(const SceneSpec&, SpecChecker&) {}

void useWall(const SceneSpec&, SceneModel& model) {
  for (std::uint32_t i = 0; i < model.layer_count; ++i)
    model.axial_stiffness_N_per_m =
        std::max(model.axial_stiffness_N_per_m, model.layers[i].wall_stiffness_N_per_m);
  model.cut_reach = [](const SceneModel& scene, SimState& state, double) noexcept {
    return scene.layers[state.layer].cut_stretch_m;
  };
}

}  // namespace

constinit const AxialEntry kTrackingWallEntry = {&kWallSteps, nothingToCheck, effectsOfLayers, useWall};

constinit const AxialEntry kPlainWallEntry = {
    &kWallSteps, nothingToCheck,
    [](const SceneSpec& spec) { return effectsOfLayers(spec) & bitOf(Effect::kCutting); }, useWall};

}  // namespace needlelab
