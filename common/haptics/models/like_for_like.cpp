#include "common/haptics/models/like_for_like.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "common/haptics/models/axial_entry.h"

namespace needlelab {
namespace {

constexpr double kChange_m = 1e-5;  // the distance over which a table's force falls
// E over k', from 2(1 + ν)(3 − 4ν) ln 100/(8π(1 − ν)) at ν = 0.45
constexpr double kYoungPerLateral = 1.16;
constexpr double kLeastPuncture_N = 1e-3;  // FIRST_ORDER and OKAMURA require a value above 0

bool lists(const SceneSpec& scene, Effect effect) {
  return (scene.effects & bitOf(effect)) != 0;
}
double cuttingOf(const SceneSpec& scene, const LayerSpec& layer) {
  return lists(scene, Effect::kCutting) ? layer.cutting_force_N : 0.0;
}
double frictionOf(const SceneSpec& scene, const LayerSpec& layer) {
  return lists(scene, Effect::kShaftFriction) ? layer.friction_N_per_m : 0.0;
}

// a membrane's force over the depth at which it ruptures
double secantStiffness(const MembraneSpec& m) {
  return (m.linear_N_per_m +
          std::sqrt(m.linear_N_per_m * m.linear_N_per_m + 4 * m.quadratic_N_per_m2 * m.force_N)) /
         2;
}

double wallStiffness(const SceneSpec& scene, const LayerSpec& layer) {
  return layer.wall_stiffness_N_per_m.value_or(scene.tracking_wall.stiffness_N_per_m);
}

void deriveFirstOrder(SceneSpec& scene) {
  double cutting_before_N = 0;
  for (LayerSpec& layer : scene.layers) {
    const double cutting_N = cuttingOf(scene, layer);
    if (!layer.first_order) {
      FirstOrderSpec& own = layer.first_order.emplace();
      own.cutting_force_N = cutting_N;
      own.friction_N_per_m = frictionOf(scene, layer);
      if (lists(scene, Effect::kPuncture) && layer.membrane) {
        own.puncture_force_N = layer.membrane->force_N;
        own.stiffness_N_per_m = std::clamp(secantStiffness(*layer.membrane), 1e-6, 1e4);
      } else {
        own.puncture_force_N = std::max(kLeastPuncture_N, cutting_N - cutting_before_N);
        own.stiffness_N_per_m = wallStiffness(scene, layer);
      }
    }
    cutting_before_N = cutting_N;
  }
  scene.effects |= bitOf(Effect::kCutting);
}

// Ratios to kinetic friction: assumptions, quoted from memory as those of bovine liver (Okamura, Simone and
// O'Leary 2004: 18.57 and 11.96 N/m, 293 N·s/m² on the way in; 18.45, 10.57, 212 out), without access to the
// paper.
constexpr double kStaticIn = 1.55, kStaticOut = 1.75, kViscousIn_s_per_m = 24.5, kViscousOut_s_per_m = 20.1;

void deriveOkamura(SceneSpec& scene) {
  double cutting_before_N = 0;
  for (LayerSpec& layer : scene.layers) {
    const double cutting_N = cuttingOf(scene, layer), friction_N_per_m = frictionOf(scene, layer);
    if (!layer.okamura) {
      OkamuraSpec& own = layer.okamura.emplace();
      own.cutting_force_N = cutting_N;
      own.in = {friction_N_per_m, std::min(1e4, kStaticIn * friction_N_per_m),
                std::min(1e5, kViscousIn_s_per_m * friction_N_per_m)};
      own.out = {friction_N_per_m, std::min(1e4, kStaticOut * friction_N_per_m),
                 std::min(1e5, kViscousOut_s_per_m * friction_N_per_m)};
      if (lists(scene, Effect::kPuncture) && layer.membrane) {
        own.puncture_force_N = layer.membrane->force_N;
        own.linear_N_per_m = std::min(1e4, layer.membrane->linear_N_per_m);
        own.quadratic_N_per_m2 = layer.membrane->quadratic_N_per_m2;
      } else {
        own.puncture_force_N = std::max(kLeastPuncture_N, cutting_N - cutting_before_N);
        own.linear_N_per_m = wallStiffness(scene, layer);
      }
    }
    cutting_before_N = cutting_N;
  }
  scene.effects |= bitOf(Effect::kCutting);
}

void deriveFem(SceneSpec& scene) {
  if (scene.fem.layers.empty()) scene.fem.nodes = kDefaultFemNodes;
  if (scene.fem.layers.empty())
    for (const LayerSpec& layer : scene.layers) {
      FemLayerSpec own;
      own.poisson = kDefaultPoisson;
      const double young_Pa = kYoungPerLateral * layer.lateral_stiffness_N_per_m2;
      own.young_Pa = young_Pa > 0 ? std::clamp(young_Pa, 100.0, 1e9) : kDefaultYoung_Pa;
      own.friction_N_per_m = frictionOf(scene, layer);
      own.cutting_N = cuttingOf(scene, layer);
      scene.fem.layers.push_back(own);
    }
  scene.effects |= bitOf(Effect::kCutting);
}

template <class Section>
void deriveStiffness(const SceneSpec& scene, Section& section) {
  if (section.stiffness_N_per_m == Section{}.stiffness_N_per_m)
    section.stiffness_N_per_m = scene.tracking_wall.stiffness_N_per_m;
}

}  // namespace

std::string frictionAssumption(const SceneSpec& scene, AxialModel model) {
  const bool okamura = model == AxialModel::kOkamura;
  if ((!okamura && model != AxialModel::kDahl) || model == scene.axial_model) return {};
  bool derived = false, rubs = false;
  for (const LayerSpec& layer : scene.layers) {
    derived = derived || !layer.okamura;
    rubs = rubs || (!layer.okamura && frictionOf(scene, layer) > 0);
  }
  if (!derived) return {};
  if (!rubs)
    return "The scene has no friction: what tells this model's from FIRST_ORDER's is not in this row";
  std::string ratios = fmt::format("viscous friction of {:g} (in) and {:g} s/m (out) times kinetic",
                                   kViscousIn_s_per_m, kViscousOut_s_per_m);
  if (okamura)
    ratios =
        fmt::format("static friction of {:g} (in) and {:g} (out) times kinetic, ", kStaticIn, kStaticOut) +
        ratios;
  return "Assumptions, remembered of bovine liver (Okamura, Simone and O'Leary 2004) and not compared with "
         "the paper: " +
         ratios;
}

std::vector<PrecomputedSpec::Row> forceTableOfLayers(const SceneSpec& scene) {
  const double stiffness = scene.tracking_wall.stiffness_N_per_m;
  std::vector<PrecomputedSpec::Row> table;
  double top_m = 0, cutting_N = 0, attracted_N = 0;
  for (std::size_t i = 0; i < scene.layers.size(); ++i) {
    const LayerSpec& layer = scene.layers[i];
    const double bottom_m = top_m + layer.thickness_m;
    const double wanted_N = cuttingOf(scene, layer), before_N = cutting_N, attracted_before_N = attracted_N;
    attracted_N = lists(scene, Effect::kAttracted) ? layer.attracted_force_N : 0.0;
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

SceneSpec likeForLike(const SceneSpec& scene, AxialModel model) {
  SceneSpec other = scene;
  other.axial_model = model;
  if (model == scene.axial_model) return other;
  switch (model) {
    case AxialModel::kEnhancedTrackingWall:
    case AxialModel::kTrackingWall:
      break;
    case AxialModel::kDirect:
      deriveStiffness(scene, other.direct);
      break;
    case AxialModel::kVoigt:
      deriveStiffness(scene, other.voigt);
      break;
    case AxialModel::kGodObject:
      deriveStiffness(scene, other.god_object);
      break;
    case AxialModel::kFirstOrder:
      deriveFirstOrder(other);
      break;
    case AxialModel::kPrecomputed:
      if (other.precomputed.table.empty()) other.precomputed.table = forceTableOfLayers(scene);
      break;
    case AxialModel::kStatistical:
      if (other.statistical.table.empty())
        for (const auto& row : forceTableOfLayers(scene))
          other.statistical.table.push_back({row.depth_m, row.cutting_N, kSyntheticSdShare * row.cutting_N});
      break;
    case AxialModel::kFem:
      deriveFem(other);
      break;
    case AxialModel::kOkamura:
    case AxialModel::kDahl:
      deriveOkamura(other);
      break;
  }
  if (model != AxialModel::kEnhancedTrackingWall && model != AxialModel::kTrackingWall)
    for (LayerSpec& layer : other.layers) layer.wall_stiffness_N_per_m.reset();
  other.effects &= ~axialEntry(model).replaces;
  return other;
}

}  // namespace needlelab
