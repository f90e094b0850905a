/// ENHANCED_TRACKING_WALL: cutting and attracted force by the wall of FORCE_MODEL.md, "Tracking wall" (paper
/// eq. 1-6), and TRACKING_WALL, its predecessor of 2018: the same wall for insertion and stop, without
/// attracted force.
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/step_live.h"

namespace needlelab {
namespace {

constexpr StepTable kWallSteps = stepTable<LayeredWall>();

void useWall(const SceneSpec&, SceneModel& model) {
  for (std::uint32_t i = 0; i < model.layer_count; ++i)
    model.axial_stiffness_N_per_m =
        std::max(model.axial_stiffness_N_per_m, model.layers[i].wall_stiffness_N_per_m);
  model.cut_reach = [](const SceneModel& scene, SimState& state, double) noexcept {
    return scene.layers[state.layer].cut_stretch_m;
  };
}

}  // namespace

extern const AxialEntry kTrackingWallEntry, kPlainWallEntry;
constinit const AxialEntry kTrackingWallEntry = {.model = AxialModel::kEnhancedTrackingWall,
                                                 .label = "Enhanced tracking wall",
                                                 .short_name = "wall",
                                                 .steps = &kWallSteps,
                                                 .renders = LayeredWall::kRenders,
                                                 .has_tracking_wall = true,
                                                 .follows_layers = true,
                                                 .compile = useWall};

constinit const AxialEntry kPlainWallEntry = {.model = AxialModel::kTrackingWall,
                                              .label = "Tracking wall",
                                              .short_name = "wall 2018",
                                              .steps = &kWallSteps,
                                              .renders = bitOf(Effect::kCutting),
                                              .has_tracking_wall = true,
                                              .follows_layers = true,
                                              .compile = useWall};

}  // namespace needlelab
