/// Cutting and attracted force: the enhanced tracking wall (paper eq. 1–6; FORCE_MODEL.md, "Tracking wall").
/// The needle drags one wall w behind it on the way in and ahead of it on the way out; in a stop the wall
/// creeps up to the needle. Every move of the wall shrinks |x − w|: the element only dissipates, so it needs
/// no damper.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/haptics/tick.h"

namespace needlelab {

/// Counts slow ticks, begins and ends stops, sets the phase. Runs with or without a live wall.
/// Returns true at the tick that begins a stop.
[[gnu::always_inline]] inline bool updatePhase(const SceneModel& model, SimState& state, double speed_mps) {
  const double stop_speed = model.wall.stop_speed_mps;
  const double size = std::fabs(speed_mps);
  if (size >= stop_speed) {
    if (state.stopped) {
      if (size < 2.0 * stop_speed) return false;
      state.stopped = false;
    }
    state.slow_ticks = 0;
    state.phase = speed_mps > 0.0 ? Phase::kInserting : Phase::kWithdrawing;
    return false;
  }
  if (state.stopped || ++state.slow_ticks < model.dwell_ticks) return false;
  state.stopped = true;
  state.phase = Phase::kStopped;
  return true;
}

/// Returns the wall after the update in a stop (eq. 4 and 5, as a ramp that depends on the needle's place).
[[gnu::always_inline]] inline double relaxedWall(const SceneModel& model, SimState& state, double x_m,
                                                 double rejection_m, bool begins) {
  const double stretch = x_m - state.wall_m;
  const double size = std::fabs(stretch);
  double move;
  if (model.wall.stop_mode == StopMode::kRamp) {
    const double gap = std::max(0.0, size - rejection_m);
    if (begins) state.stop_step_m = 0.0;
    state.stop_step_m = std::max(state.stop_step_m, gap / model.stop_ticks);
    move = std::min(state.stop_step_m, gap);
  } else {
    if (begins) state.stop_stretch_m = size;
    const double rest = std::max(rejection_m, model.wall.relax_residual * state.stop_stretch_m);
    move = std::max(0.0, size - rest) * model.relax_share;
  }
  return state.wall_m + std::copysign(std::min(move, model.max_stop_step_m), stretch);
}

/// The greatest distances of the wall from the needle in this tick: Δ_cut, Δ_att before it fades at the
/// surface, and the rest after a stop.
struct WallStretch {
  double cut_m = 0;
  double attracted_m = 0;
  double rejection_m = 0;
};

/// CUTTING's place in a tick: the wall's position when the needle drags it behind.
template <bool kLive>
struct CuttingStep {
  [[gnu::always_inline]] static double behind(double x_m, const WallStretch& stretch) {
    return kLive ? x_m - stretch.cut_m : x_m;
  }
};

/// ATTRACTED's place in a tick: the wall's position when the needle drags it ahead.
template <bool kLive>
struct AttractedStep {
  [[gnu::always_inline]] static double ahead(double x_m, double insertion_m, const WallStretch& stretch) {
    return kLive ? x_m + std::min(stretch.attracted_m, insertion_m) : x_m;
  }
};

/// Force along u: negative is cutting, positive is attracted. The wall is never behind the needle when
/// CUTTING is not live, and never ahead of it when ATTRACTED is not live.
template <class Cutting = CuttingStep<true>, class Attracted = AttractedStep<true>>
[[gnu::always_inline]] inline double applyTrackingWall(const SceneModel& model, SimState& state,
                                                       const Tick& tick, bool stop_begins,
                                                       const WallStretch& stretch, StepReport& report) {
  [[maybe_unused]] const Cutting cutting;
  [[maybe_unused]] const Attracted attracted;
  const double x = tick.x_cut_m;
  double wall = state.wall_m;
  if (state.stopped) wall = relaxedWall(model, state, x, stretch.rejection_m, stop_begins);
  const double ahead = attracted.ahead(x, tick.insertion_m, stretch);
  const double behind = cutting.behind(x, stretch);
  wall = std::min(std::max(wall, behind), ahead);
  state.wall_m = wall;
  const double force = -model.wall.stiffness_N_per_m * (x - wall);
  report.cutting_N = force < 0.0 ? force : 0.0;
  report.attracted_N = force < 0.0 ? 0.0 : force;
  return force;
}

/// The axial model of step_live.h for ENHANCED_TRACKING_WALL and TRACKING_WALL: the tip's layer sets the
/// stretches.
struct LayeredWall {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  static constexpr bool kHasWall = true;

  template <EffectMask Live, class Steps>
  [[gnu::always_inline]] static double apply(const SceneModel& model, SimState& state, const Tick& tick,
                                             bool stop_begins, StepReport& report) {
    using Cutting = typename Steps::template Cutting<(Live & bitOf(Effect::kCutting)) != 0>;
    using Attracted = typename Steps::template Attracted<(Live & bitOf(Effect::kAttracted)) != 0>;
    const CompiledLayer& layer = *tick.layer;
    return applyTrackingWall<Cutting, Attracted>(
        model, state, tick, stop_begins,
        {layer.cut_stretch_m, layer.attracted_stretch_m, layer.rejection_stretch_m}, report);
  }
};

}  // namespace needlelab
