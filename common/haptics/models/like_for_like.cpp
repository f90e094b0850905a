#include "common/haptics/models/like_for_like.h"

#include <algorithm>

#include "common/haptics/axial_entry.h"
#include "common/haptics/models/layer_forces.h"

namespace needlelab {
namespace {

constexpr double kChange_m = 1e-5;  // the distance over which a table's force falls

}  // namespace

SceneSpec likeForLike(const SceneSpec& scene, AxialModel model) {
  SceneSpec other = scene;
  other.axial_model = model;
  if (model == scene.axial_model) return other;
  const AxialEntry& axial = axialEntry(model);
  if (axial.derive != nullptr) axial.derive(scene, other);
  if (!axial.follows_layers)
    for (LayerSpec& layer : other.layers) layer.wall_stiffness_N_per_m.reset();
  other.effects &= ~axial.replaces;
  return other;
}

std::string frictionAssumption(const SceneSpec& scene, AxialModel model) {
  const AxialEntry& axial = axialEntry(model);
  return model == scene.axial_model || axial.assumption == nullptr ? std::string() : axial.assumption(scene);
}

std::vector<PrecomputedSpec::Row> forceTableOfLayers(const SceneSpec& scene) {
  const double stiffness = scene.tracking_wall.stiffness_N_per_m;
  const bool attracts = (scene.effects & bitOf(Effect::kAttracted)) != 0;
  std::vector<PrecomputedSpec::Row> table;
  double top_m = 0, cutting_N = 0, attracted_N = 0;
  for (std::size_t i = 0; i < scene.layers.size(); ++i) {
    const LayerSpec& layer = scene.layers[i];
    const double bottom_m = top_m + layer.thickness_m;
    const double wanted_N = listedCutting_N(scene, layer), before_N = cutting_N,
                 attracted_before_N = attracted_N;
    attracted_N = attracts ? layer.attracted_force_N : 0.0;
    if (i == 0) table.push_back({0, 0, attracted_N});

    // a fall and the attracted force take effect at once, a rise follows the wall's spring
    const double rise_m = std::max(0.0, wanted_N - before_N) / stiffness;
    const double change_m = std::min(kChange_m, layer.thickness_m / 4);
    if (wanted_N < before_N || (i > 0 && attracted_N != attracted_before_N)) {
      cutting_N = std::min(wanted_N, before_N + stiffness * change_m);
      table.push_back({top_m + change_m, cutting_N, attracted_N});
    }
    const double end_m = std::min(top_m + rise_m, bottom_m);
    if (end_m > table.back().depth_m) {
      cutting_N = std::min(wanted_N, before_N + stiffness * (end_m - top_m));
      table.push_back({end_m, cutting_N, attracted_N});
    }
    if (i + 1 < scene.layers.size() && bottom_m > table.back().depth_m)
      table.push_back({bottom_m, cutting_N, attracted_N});
    top_m = bottom_m;
  }
  return table;
}

}  // namespace needlelab
