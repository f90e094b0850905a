/// Ready-made scenes for every axial model.
#pragma once

#include <array>
#include <cmath>
#include <memory>

#include "common/haptics/models/fem_needle.h"
#include "common/haptics/models/like_for_like.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {

/// FEM is the last.
inline constexpr auto kAllModels = [] {
  std::array<AxialModel, kAxialModelCount> models{};
  std::size_t next = 0;
  for (std::size_t i = 0; i < kAxialModelCount; ++i)
    if (static_cast<AxialModel>(i) != AxialModel::kFem) models[next++] = static_cast<AxialModel>(i);
  models[next] = AxialModel::kFem;
  return models;
}();

/// A synthetic compliance, positive definite: stations 2 mm apart, coupled with their neighbours.
inline std::shared_ptr<const NeedleCompliance> someCompliance() {
  auto made = std::make_shared<NeedleCompliance>();
  made->spacing_m = 2e-3;
  made->radius_m = 4e-4;
  constexpr std::size_t kStations = 24;
  for (std::size_t i = 0; i < kStations; ++i) {
    made->depth_m.push_back((static_cast<double>(i) + 0.5) * made->spacing_m);
    for (std::size_t j = 0; j < kStations; ++j)
      made->give_m_per_N.push_back(0.02 /
                                   (1.0 + 2.0 * std::abs(static_cast<double>(i) - static_cast<double>(j))));
  }
  for (std::size_t i = 0; i < kStations; ++i) made->give_m_per_N[i * kStations + i] *= 3;
  return made;
}

/// The scene rendered by that model, ready to compile.
inline SceneSpec renderedBy(const SceneSpec& scene, AxialModel model) {
  SceneSpec other = likeForLike(scene, model);
  if (model == AxialModel::kFem) other.fem.compliance = someCompliance();
  return other;
}

/// The six layers with the paper's effects, which every model can render. OKAMURA and DAHL get friction with
/// values like those of bovine liver, and stiffening tops.
inline SceneSpec modelScene(AxialModel model, LimbKind limb = LimbKind::kPlane) {
  SceneSpec scene = renderedBy(withLimb(paperSixLayers(), limb), model);
  for (LayerSpec& layer : scene.layers) {
    if (!layer.okamura) continue;
    layer.okamura->quadratic_N_per_m2 = 2e4;
    layer.okamura->in = {12, 18.6, 293};
    layer.okamura->out = {10.6, 18.5, 212};
  }
  return scene;
}

}  // namespace needlelab::test
