/// Shaft friction: a second tracking wall, dragged in both directions, stronger with inserted length. In a
/// stop it relaxes until nothing is left (FORCE_MODEL.md, "Shaft friction").
#pragma once

#include <algorithm>
#include <cassert>

#include "common/haptics/effects/relaxation.h"
#include "common/haptics/tick.h"

namespace needlelab {

/// Force along u, against the motion: at most ∫₀^{d_t} friction ds.
[[gnu::always_inline]] inline double applyShaftFriction(const SceneModel& model, SimState& state,
                                                        const Tick& tick, StepReport& report) {
  assert(model.friction_stiffness_N_per_m > 0.0);
  const LayerSpan& span = spanAt(state, tick.insertion_m);
  const double max_N = span.friction_offset_N + span.friction_N_per_m * tick.insertion_m;
  const double stretch = max_N / model.friction_stiffness_N_per_m;
  state.friction_wall_m =
      std::min(std::max(state.friction_wall_m, tick.x_cut_m - stretch), tick.x_cut_m + stretch);
  return report.friction_N = -model.friction_stiffness_N_per_m * (tick.x_cut_m - state.friction_wall_m);
}

/// The effect's place in a tick.
template <bool kLive>
struct ShaftFrictionStep {
  /// Runs before the axial force: a model with its own friction also writes the report's friction.
  [[gnu::always_inline]] static void clear(StepReport& report) {
    if constexpr (!kLive) report.friction_N = 0.0;
  }
  [[gnu::always_inline]] static double apply(const SceneModel& model, SimState& state, const Tick& tick,
                                             bool stop_begins, StepReport& report) {
    if constexpr (!kLive) return 0.0;
    if (state.stopped)
      state.friction_wall_m =
          relaxedWall(model, state.friction_rest, state.friction_wall_m, tick.x_cut_m, 0.0, stop_begins);
    return applyShaftFriction(model, state, tick, report);
  }
};

}  // namespace needlelab
