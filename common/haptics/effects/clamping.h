/// Clamping force: a virtual fixture toward the trajectory line, stiffer with depth (paper eq. 8;
/// FORCE_MODEL.md, "Clamping").
#pragma once

#include <algorithm>

#include "common/haptics/tick.h"

namespace needlelab {

/// k = min(∫₀^{d_t} lateral_stiffness ds, max_stiffness): the integral is offset/c + slope·d_t in the layer
/// that d_t reaches.
[[gnu::always_inline]] inline double clampingStiffness(const SceneModel& model, SimState& state,
                                                       double insertion_m) {
  const CompiledLayer& layer = layerByLength(model, state, insertion_m);
  const double k = layer.lateral_offset_N_per_m * state.inverse_slant + layer.lateral_N_per_m2 * insertion_m;
  return std::min(std::max(0.0, k), model.fixture.max_stiffness_N_per_m);
}

/// Change of trajectory: turns u about P0 toward the tip and moves all lengths along u with it, so that no
/// force jumps. Rare, hence a separate function. `k_N_per_m` is the stiffness of this tick; recomputes
/// `tick`.
bool turnTrajectory(const SceneModel& model, const TipSample& sample, SimState& state, double k_N_per_m,
                    Tick& tick) noexcept;

/// PASSIVE: stiffness that grows under a deviation would store energy that the hand did not supply; the dead
/// radius ρ removes it. Returns the capped force.
inline double passiveForce(SimState& state, double k_N_per_m, double lateral_m, double most_N) {
  double& rho = state.dead_radius_m;
  if (k_N_per_m > state.k_prev_N_per_m && state.e_prev_m > rho)
    rho = state.e_prev_m - state.k_prev_N_per_m / k_N_per_m * (state.e_prev_m - rho);
  rho = std::min(rho, lateral_m);
  state.k_prev_N_per_m = k_N_per_m;
  state.e_prev_m = lateral_m;
  const double force_N = k_N_per_m * (lateral_m - rho);
  if (force_N > most_N) rho = lateral_m - most_N / k_N_per_m;
  return force_N;
}

/// Returns the clamping force in W and fills the report's clamping fields. May turn u: compute everything
/// that depends on u after it.
[[gnu::always_inline]] inline Vec3 applyClamping(const SceneModel& model, const TipSample& sample,
                                                 SimState& state, Tick& tick, StepReport& report) {
  const double most_N = model.fixture.max_force_N;
  const bool passive = model.fixture.mode == ClampingMode::kPassive;
  double k = clampingStiffness(model, state, tick.insertion_m);
  double force_N = k * tick.lateral_m;
  if (passive || force_N > most_N) [[unlikely]] {
    if (k * (tick.lateral_m - state.dead_radius_m) > most_N && tick.x_m > tick.lateral_m) {
      Tick turned;
      turned.depth_m = tick.depth_m;
      turned.layer = tick.layer;
      if (turnTrajectory(model, sample, state, k, turned)) report.flags |= kFlagTurn;
      tick = turned;
      k = clampingStiffness(model, state, tick.insertion_m);
      force_N = k * tick.lateral_m;
    }
    if (passive) force_N = passiveForce(state, k, tick.lateral_m, most_N);
    if (force_N > most_N) {
      force_N = most_N;
      report.flags |= kFlagClampCapped;
    }
  }
  report.clamping_N = force_N;
  report.clamping_stiffness_N_per_m = k;
  if (force_N <= 0.0) [[unlikely]]
    return {};
  return tick.lateral_W_m * (-force_N / tick.lateral_m);
}

/// The effect's place in a tick.
template <bool kLive>
struct ClampingStep {
  [[gnu::always_inline]] static Vec3 apply(const SceneModel& model, const TipSample& sample, SimState& state,
                                           Tick& tick, StepReport& report) {
    return applyClamping(model, sample, state, tick, report);
  }
  /// Runs in place of `apply` when the effect is not live.
  [[gnu::always_inline]] static void clear(StepReport& report) {
    report.clamping_N = report.clamping_stiffness_N_per_m = 0.0;
  }
};

}  // namespace needlelab
