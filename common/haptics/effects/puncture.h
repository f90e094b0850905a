/// Membranes at the tops of layers: a force that grows until it ruptures (FORCE_MODEL.md, "Puncture").
#pragma once

#include <algorithm>
#include <bit>
#include <cassert>

#include "common/haptics/tick.h"

namespace needlelab {

inline std::uint32_t intactMembranes(const SimState& state) {
  const std::uint32_t met = state.membranes_met == 32 ? ~0u : (1u << state.membranes_met) - 1u;
  assert(state.membranes_met <= kMaxLayers);
  assert((state.membranes_ruptured & ~met) == 0 && "only a membrane that was met ruptures");
  return met & ~state.membranes_ruptured;
}

/// x_c = min(x, places of the intact membranes that were met).
inline double cuttingPosition(const SimState& state, double x_m) {
  double x_cut = x_m;
  for (std::uint32_t left = intactMembranes(state); left != 0; left &= left - 1)
    x_cut = std::min(x_cut, state.membrane_place_m[static_cast<std::size_t>(std::countr_zero(left))]);
  return x_cut;
}

/// The force of the intact membranes along u, never positive.
inline double membranesForce(const SceneModel& model, const SimState& state, double x_m) {
  double force_N = 0.0;
  for (std::uint32_t left = intactMembranes(state); left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    const double z = x_m - state.membrane_place_m[i];
    if (z > 0.0) force_N -= model.membranes[i].k1_N_per_m * z + model.membranes[i].k2_N_per_m2 * (z * z);
  }
  return force_N;
}

/// Updates the places of membranes that the tip reaches, ruptures, and x_c. Returns the membranes' force
/// along u (never positive). `x_before_m`, `depth_before_m`: the previous tick; at the entry tick where the
/// walls begin (0, if the line has not moved) and 0.
[[gnu::always_inline]] inline double applyMembranes(const SceneModel& model, SimState& state, Tick& tick,
                                                    double x_before_m, double depth_before_m,
                                                    StepReport& report) {
  while (state.membranes_met < model.membrane_count &&
         tick.depth_m >= model.membranes[state.membranes_met].top_m) {
    const double share =
        (model.membranes[state.membranes_met].top_m - depth_before_m) / (tick.depth_m - depth_before_m);
    assert(share >= 0.0 && share <= 1.0);
    state.membrane_place_m[state.membranes_met++] = x_before_m + (tick.x_m - x_before_m) * share;
  }
  tick.x_cut_m = cuttingPosition(state, tick.x_m);

  double force = 0.0;
  bool ruptured = false;
  for (std::uint32_t left = intactMembranes(state); left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    const double z = tick.x_m - state.membrane_place_m[i];
    if (z <= 0.0) continue;
    const CompiledMembrane& membrane = model.membranes[i];
    const double held = membrane.k1_N_per_m * z + membrane.k2_N_per_m2 * (z * z);
    if (held >= membrane.force_N) {
      state.membranes_ruptured |= 1u << i;
      ruptured = true;
    } else {
      force -= held;
    }
  }
  if (ruptured) {
    // the walls were held back at the membrane: they now follow the tip, and their forces do not change
    report.flags |= kFlagRupture;
    const double x_cut = cuttingPosition(state, tick.x_m);
    state.wall_m += x_cut - tick.x_cut_m;
    state.friction_wall_m += x_cut - tick.x_cut_m;
    tick.x_cut_m = x_cut;
  }
  if (tick.x_cut_m < tick.x_m) {
    // in against an intact membrane a wall ahead, which pulls, falls behind by the way: otherwise it would
    // pull with the same force all the way
    const double gone_m = std::max(0.0, tick.x_m - std::max(x_before_m, tick.x_cut_m));
    for (double* wall_m : {&state.wall_m, &state.friction_wall_m})
      if (*wall_m > tick.x_cut_m) *wall_m = std::max(tick.x_cut_m, *wall_m - gone_m);
  }
  assert(!(force > 0.0));
  return report.puncture_N = force;
}

/// The effect's place in a tick.
template <bool kLive>
struct PunctureStep {
  double x_before_m = 0.0;

  /// Runs before the tick's own position enters the history.
  [[gnu::always_inline]] void rememberPlace(const SceneModel& model, const SimState& state, bool entry) {
    if constexpr (kLive)
      x_before_m = entry ? std::max(0.0, state.wall_m)
                         : state.x_history_m[state.ticks_inside & model.history_mask] + state.x_shift_m;
  }
  [[gnu::always_inline]] double apply(const SceneModel& model, SimState& state, Tick& tick, bool entry,
                                      StepReport& report) const {
    if constexpr (kLive)
      return applyMembranes(model, state, tick, x_before_m, entry ? 0.0 : state.depth_prev_m, report);
    return report.puncture_N = 0.0;
  }
};

}  // namespace needlelab
