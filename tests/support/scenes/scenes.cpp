#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

Site siteAt(Vec3 p, Vec3 inward, Vec3 hint) {
  const Vec3 across_1 = normalized(hint - inward * dot(hint, inward));
  return {p, inward, across_1, cross(inward, across_1)};
}

}  // namespace

SceneSpec paperOneDof() {
  SceneSpec scene;
  LayerSpec layer;
  layer.thickness_m = 0.1;
  layer.cutting_force_N = 1.0;
  layer.attracted_force_N = 0.5;
  layer.rejection_force_N = 0.1;
  scene.layers = {layer};
  scene.needle_length_m = 0.06;
  scene.effects = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  return scene;
}

SceneSpec paperSixLayers() {
  static constexpr std::array<double, 6> kCutting_N = {1.0, 2.0, 1.5, 2.5, 3.0, 4.0};
  static constexpr std::array<double, 6> kThickness_m = {0.003, 0.010, 0.004, 0.005, 0.004, 0.014};
  static constexpr std::array<double, 6> kLateral_N_per_m2 = {9000, 6000, 12000, 15000, 20000, 40000};
  SceneSpec scene;
  for (std::size_t i = 0; i < kCutting_N.size(); ++i) {
    LayerSpec layer;
    layer.thickness_m = kThickness_m[i];
    layer.cutting_force_N = kCutting_N[i];
    layer.attracted_force_N = 0.4;
    layer.rejection_force_N = 0.1;
    layer.lateral_stiffness_N_per_m2 = kLateral_N_per_m2[i];
    scene.layers.push_back(layer);
  }
  scene.needle_length_m = 0.06;
  scene.orientation_limit = {0.5, 0.2};
  scene.effects = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted) | bitOf(Effect::kClamping) |
                  bitOf(Effect::kOrientationLimit);
  return scene;
}

SceneSpec allEffects() {
  SceneSpec scene = paperSixLayers();
  static constexpr std::array<double, 6> kFriction_N_per_m = {18, 10, 14, 20, 25, 30};
  for (std::size_t i = 0; i < scene.layers.size(); ++i)
    scene.layers[i].friction_N_per_m = kFriction_N_per_m[i];
  scene.layers[0].membrane = MembraneSpec{200, 20'000, 0.6};
  scene.layers[2].membrane = MembraneSpec{100, 60'000, 0.8};
  scene.layers[4].membrane = MembraneSpec{300, 0, 0.5};
  scene.effects = kPlacedEffects;
  return scene;
}

std::string_view limbName(LimbKind kind) {
  switch (kind) {
    case LimbKind::kPlane:
      return "plane";
    case LimbKind::kTiltedPlane:
      return "tilted plane";
    case LimbKind::kSphere:
      return "sphere";
    case LimbKind::kCapsule:
      return "capsule";
  }
  return "?";
}

Limb limbOf(LimbKind kind) {
  switch (kind) {
    case LimbKind::kPlane:
      return PlaneLimb{{0, 0, 0}, {0, 0, 1}};
    case LimbKind::kTiltedPlane:
      return PlaneLimb{{0.3, -0.1, 0.05}, {2, -1, 3}};
    case LimbKind::kSphere:
      return SphereLimb{{0.4, 0.1, -0.06}, 0.08};
    case LimbKind::kCapsule:
      return CapsuleLimb{{0.5, -0.1, 0.02}, {0.5, 0.1, 0.02}, 0.045};
  }
  return PlaneLimb{};
}

Site siteOf(LimbKind kind) {
  switch (kind) {
    case LimbKind::kPlane:
      return defaultSite();
    case LimbKind::kTiltedPlane:
      return siteAt({0.3, -0.1, 0.05}, -normalized(Vec3{2, -1, 3}), {1, 0, 0});
    case LimbKind::kSphere: {
      const Vec3 out = normalized(Vec3{0.2, -0.3, 0.9});
      return siteAt(Vec3{0.4, 0.1, -0.06} + out * 0.08, -out, {1, 0, 0});
    }
    case LimbKind::kCapsule: {
      const Vec3 out = normalized(Vec3{0.6, 0, 0.8});
      return siteAt(Vec3{0.5, 0.03, 0.02} + out * 0.045, -out, {0, 1, 0});
    }
  }
  return defaultSite();
}

Site defaultSite() {
  return siteAt({0, 0, 0}, {0, 0, -1}, {1, 0, 0});
}

SceneSpec withLimb(SceneSpec scene, LimbKind kind) {
  scene.limb = limbOf(kind);
  return scene;
}

SceneSpec withEffects(SceneSpec scene, EffectMask effects) {
  scene.effects = effects;
  return scene;
}

SceneSpec withClamping(SceneSpec scene, ClampingMode mode) {
  scene.virtual_fixture.mode = mode;
  return scene;
}

SceneSpec withStop(SceneSpec scene, StopMode mode) {
  scene.tracking_wall.stop_mode = mode;
  return scene;
}

}  // namespace needlelab::test
