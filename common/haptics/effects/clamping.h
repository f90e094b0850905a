/// Clamping force: a virtual fixture toward the trajectory line, stiffer with depth (paper eq. 8; DESIGN
/// §3.3).
#pragma once

#include <algorithm>

#include "haptics/effects/tick.h"

namespace needlelab {

/// k = min(∫₀^{d_t} lateral_stiffness ds, max_stiffness): the integral is offset/c + slope·d_t in the layer
/// that d_t reaches.
inline double clampingStiffness(const SceneModel& model, SimState& state, double insertion_m) {
  state.layer_by_length = layerAt(model, insertion_m * state.slant, state.layer_by_length);
  const CompiledLayer& layer = model.layers[state.layer_by_length];
  const double k = layer.lateral_offset_N_per_m * state.inverse_slant + layer.lateral_N_per_m2 * insertion_m;
  return std::min(std::max(k, 0.0), model.fixture.max_stiffness_N_per_m);
}

/// Change of trajectory: turns u about P0 toward the tip and moves what is measured along u with it, so that
/// no force jumps. Rare, hence apart. `k_N_per_m` is the stiffness of this tick.
bool turnTrajectory(const SceneModel& model, SimState& state, Tick& tick, double k_N_per_m) noexcept;

/// Returns the clamping force in W and fills the report's clamping fields. May turn u: everything that
/// depends on u comes after it.
inline Vec3 applyClamping(const SceneModel& model, SimState& state, Tick& tick, StepReport& report) {
  const double most_N = model.fixture.max_force_N;
  double k = clampingStiffness(model, state, tick.insertion_m);
  if (k * (tick.lateral_m - state.dead_radius_m) > most_N && tick.x_m > tick.lateral_m) [[unlikely]] {
    if (turnTrajectory(model, state, tick, k)) report.flags |= kFlagTurn;
    k = clampingStiffness(model, state, tick.insertion_m);
  }

  // PASSIVE: stiffness that grows under a deviation would store energy that nobody paid for; the dead radius
  // takes it out
  if (model.fixture.mode == ClampingMode::kPassive) {
    if (k > state.k_prev_N_per_m && state.e_prev_m > state.dead_radius_m)
      state.dead_radius_m =
          state.e_prev_m - state.k_prev_N_per_m / k * (state.e_prev_m - state.dead_radius_m);
    state.dead_radius_m = std::min(state.dead_radius_m, tick.lateral_m);
  }
  double force_N = k * (tick.lateral_m - state.dead_radius_m);
  if (force_N > most_N) {
    force_N = most_N;
    report.flags |= kFlagClampCapped;
    if (model.fixture.mode == ClampingMode::kPassive) state.dead_radius_m = tick.lateral_m - most_N / k;
  }
  state.k_prev_N_per_m = k;
  state.e_prev_m = tick.lateral_m;
  report.clamping_N = force_N;
  report.clamping_stiffness_N_per_m = k;
  if (force_N <= 0.0) return {};
  return tick.lateral_W_m * (-force_N / tick.lateral_m);
}

}  // namespace needlelab
