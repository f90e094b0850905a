/// Shared by FIRST_ORDER, OKAMURA and DAHL: every layer's top holds like a membrane until it is punctured,
/// and an unpunctured top prevents cutting and friction beyond it (FORCE_MODEL.md, "Axial models").
#pragma once

#include <algorithm>
#include <bit>
#include <cassert>

#include "common/haptics/effects/puncture.h"
#include "common/haptics/scene_spec.h"
#include "common/haptics/tick.h"

namespace needlelab {

/// The effects of such a model; derived types define `apply`.
struct LayerTops {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr EffectMask kReplaces = bitOf(Effect::kPuncture) | bitOf(Effect::kShaftFriction);
  static constexpr bool kHasWall = true;
};

/// The steepest stiffness along u. While a top holds, x_c and both walls stand still, so it is that of the
/// steepest top or that of wall and friction together.
inline double stiffnessWithTops(const SceneSpec& spec, double steepest_top_N_per_m, double friction_N_per_m) {
  return std::max(steepest_top_N_per_m, spec.tracking_wall.stiffness_N_per_m + friction_N_per_m);
}

/// Constant cutting in the open layer at x_c, only on the way in, by a dragged wall with the spring K_t.
[[gnu::always_inline]] inline double cutBeyondTops(const SceneModel& model, SimState& state, const Tick& tick,
                                                   StepReport& report) {
  assert(state.layer < model.layer_count && model.membrane_count == model.layer_count);
  const auto closed = static_cast<std::uint32_t>(std::countr_zero(intactMembranes(state)));
  double cut_m = 0.0;
  if (closed != 0) cut_m = model.layers[std::min(state.layer, closed - 1)].cut_stretch_m;
  state.wall_m = std::min(std::max(state.wall_m, tick.x_cut_m - cut_m), tick.x_cut_m);
  return report.cutting_N = -model.wall.stiffness_N_per_m * (tick.x_cut_m - state.wall_m);
}

/// The length in tissue up to the first intact top.
inline double lengthBeyondTops(const Tick& tick) {
  return std::min(tick.insertion_m, std::max(0.0, tick.x_cut_m));
}

}  // namespace needlelab
