/// What the models' rules of `likeForLike` read from a scene's layers.
#pragma once

#include <algorithm>

#include "common/haptics/scene_spec.h"

namespace needlelab {

inline constexpr double kMinPuncture_N = 1e-3;  ///< FIRST_ORDER and OKAMURA require a value above 0

/// The layer's cutting force; 0 if the scene does not list CUTTING.
inline double listedCutting_N(const SceneSpec& scene, const LayerSpec& layer) {
  return (scene.effects & bitOf(Effect::kCutting)) != 0 ? layer.cutting_force_N : 0.0;
}
/// The layer's friction per inserted length; 0 if the scene does not list SHAFT_FRICTION.
inline double listedFriction_N_per_m(const SceneSpec& scene, const LayerSpec& layer) {
  return (scene.effects & bitOf(Effect::kShaftFriction)) != 0 ? layer.friction_N_per_m : 0.0;
}
/// The layer's membrane; null if it has none, or if the scene does not list PUNCTURE.
inline const MembraneSpec* listedMembrane(const SceneSpec& scene, const LayerSpec& layer) {
  return (scene.effects & bitOf(Effect::kPuncture)) != 0 && layer.membrane ? &*layer.membrane : nullptr;
}
/// K_t in the layer.
inline double wallStiffness_N_per_m(const SceneSpec& scene, const LayerSpec& layer) {
  return layer.wall_stiffness_N_per_m.value_or(scene.tracking_wall.stiffness_N_per_m);
}

/// Calls `derive(layer, cutting_N, puncture_N)` for each layer, and lists CUTTING: the layer's cutting force,
/// and how far it is above that of the layer before, which a top without a membrane holds.
template <class Derive>
void deriveTops(SceneSpec& scene, const Derive& derive) {
  double cutting_before_N = 0;
  for (LayerSpec& layer : scene.layers) {
    const double cutting_N = listedCutting_N(scene, layer);
    derive(layer, cutting_N, std::max(kMinPuncture_N, cutting_N - cutting_before_N));
    cutting_before_N = cutting_N;
  }
  scene.effects |= bitOf(Effect::kCutting);
}

/// Replaces a stiffness that is the default by the wall's.
template <class Section>
void deriveStiffness(const SceneSpec& scene, Section& section) {
  if (section.stiffness_N_per_m == Section{}.stiffness_N_per_m)
    section.stiffness_N_per_m = scene.tracking_wall.stiffness_N_per_m;
}

}  // namespace needlelab
