/// Cutting and attracted force: the enhanced tracking wall (paper eq. 1–6; FORCE_MODEL.md, "Tracking wall").
/// The needle drags one wall w behind it on the way in and ahead of it on the way out; in a stop the wall
/// comes up to the needle once and then waits, so that the next movement meets it again. Every move of the
/// wall shrinks |x − w|: the element only dissipates, so it needs no damper.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>

#include "common/haptics/effects/relaxation.h"
#include "common/haptics/tick.h"

namespace needlelab {

/// A hand that stays within this band for kRest_s counts as resting, despite tremor: in a supported hand,
/// tremor of 4–12 Hz peaks at 0.1 mm at most. The band corresponds to a mean speed of 0.43 mm/s.
inline constexpr double kRestBand_m = 0.34e-3;
inline constexpr double kRest_s = 0.8;
/// A stop at v_stop requires an earlier movement of this many v_stop: a slow advance does not stop.
inline constexpr double kArmingSpeeds = 2.5;
/// A stretch that has grown by this much means that the hand cuts, and does not just yield to the falling
/// force.
inline constexpr double kStopGrowth_m = 0.6e-3;

/// Tracks the band of places where the needle has been; returns true in the tick in which the needle leaves
/// it, where a new band begins. Places are stored with `x_shift_m` subtracted: a turn of u is not a movement.
[[gnu::always_inline]] inline bool leavesBand(SimState& state, double x_m) {
  assert(!(state.band_low_m > state.band_high_m));
  const double place_m = x_m - state.x_shift_m;
  if (place_m > state.band_high_m)
    state.band_high_m = place_m;
  else if (place_m < state.band_low_m)
    state.band_low_m = place_m;
  else
    return false;
  if (state.band_high_m - state.band_low_m < kRestBand_m) [[likely]]
    return false;
  state.moves_in = place_m == state.band_high_m;
  state.band_low_m = state.band_high_m = place_m;
  state.band_tick = state.ticks_inside;
  return true;
}

/// Whether the needle moves across its line: further than the band within the window of the speed. Call it in
/// each slow tick. Displacement decides, not speed: tremor of 0.05 mm at 10 Hz is 3 mm/s.
inline bool movesAcross(const SceneModel& model, SimState& state, Vec3 p_W_m) {
  const std::uint64_t now = state.ticks_inside;
  const bool first = state.fast_tick + 1 == now;
  const Vec3 off = p_W_m - state.across_from_W_m;
  const double along_m = dot(off, state.u_W);
  if (!first && normSquared(off) - along_m * along_m < kRestBand_m * kRestBand_m) return false;
  const bool moves = !first && now - state.across_tick <= model.speed_window;
  state.across_from_W_m = p_W_m;
  state.across_tick = now;
  return moves;
}

/// Whether the current stop ends: judged by the stretch if the wall relaxes, otherwise by the band.
template <bool kRelaxes>
[[gnu::always_inline]] inline bool stopEnds(const SceneModel& model, SimState& state, double x_cut_m,
                                            double speed_mps, bool moved) {
  if (std::fabs(speed_mps) >= 2.0 * model.wall.stop_speed_mps) return true;
  if constexpr (!kRelaxes) return moved;
  const double stretch_m = std::fabs(x_cut_m - state.wall_m);
  if (stretch_m >= state.stop_least_m + kStopGrowth_m) return true;
  state.stop_least_m = std::min(state.stop_least_m, stretch_m);
  return false;
}

/// Whether a stop begins with this tick; call it for ticks slower than v_stop.
inline bool stopBegins(const SceneModel& model, const SimState& state) {
  const std::uint64_t now = state.ticks_inside;
  assert(state.fast_tick <= now && state.band_tick <= now);
  return (state.armed && now - state.fast_tick >= model.dwell_ticks) ||
         now - state.band_tick >= model.rest_ticks;
}

/// The phase of a needle that is slow or stopped. Inline: a call here would cost the common tick its
/// registers.
template <bool kRelaxes>
[[gnu::always_inline]] inline bool updateSlowPhase(const SceneModel& model, SimState& state, Vec3 p_W_m,
                                                   double x_m, double x_cut_m, double speed_mps, bool moved) {
  const double speed = std::fabs(speed_mps);
  const bool across = movesAcross(model, state, p_W_m);
  if (state.stopped) {
    if (!stopEnds<kRelaxes>(model, state, x_cut_m, speed_mps, moved) && !across) return false;
    state.stopped = false;
    state.armed = speed >= model.arming_speed_mps && state.ticks_inside >= model.speed_window;
    state.fast_tick = state.band_tick = state.ticks_inside;
    state.band_low_m = state.band_high_m = x_m - state.x_shift_m;
  } else if (across) {
    state.fast_tick = state.band_tick = state.ticks_inside;
  } else if (stopBegins(model, state)) {
    state.stopped = true;
    state.armed = false;
    state.stop_least_m = std::fabs(x_cut_m - state.wall_m);
    state.phase = Phase::kStopped;
    return true;
  }
  const bool inward = speed >= model.wall.stop_speed_mps ? speed_mps > 0.0 : state.moves_in;
  state.phase = inward ? Phase::kInserting : Phase::kWithdrawing;
  return false;
}

/// Begins and ends stops and sets the phase. Runs with or without a live wall; `kRelaxes`: the axial model's
/// wall relaxes in a stop. Returns true at the tick that begins a stop.
template <bool kRelaxes>
[[gnu::always_inline]] inline bool updatePhase(const SceneModel& model, SimState& state, Vec3 p_W_m,
                                               const Tick& tick) {
  const bool moved = leavesBand(state, tick.x_m);
  const double speed = std::fabs(tick.speed_mps);
  if (state.stopped || speed < model.wall.stop_speed_mps) [[unlikely]]
    return updateSlowPhase<kRelaxes>(model, state, p_W_m, tick.x_m, tick.x_cut_m, tick.speed_mps, moved);
  state.fast_tick = state.ticks_inside;
  if (speed >= model.arming_speed_mps && state.ticks_inside >= model.speed_window) state.armed = true;
  state.phase = tick.speed_mps > 0.0 ? Phase::kInserting : Phase::kWithdrawing;
  return false;
}

/// Sets the spring K_t of this tick's layer. On entering a stiffer layer the stretch shrinks, so that the
/// force has no step; on entering a softer one the stretch stays and the force falls: a release.
inline void changeStiffness(SimState& state, double x_m, double stiffness_N_per_m) {
  assert(state.wall_stiffness_N_per_m > 0.0 && stiffness_N_per_m > 0.0);
  const double share = state.wall_stiffness_N_per_m / stiffness_N_per_m;
  if (share < 1.0) state.wall_m = x_m - share * (x_m - state.wall_m);
  state.wall_stiffness_N_per_m = stiffness_N_per_m;
}

/// The greatest distances of the wall from the needle in this tick: Δ_cut, Δ_att before it fades at the
/// surface, and the rest after a stop; and the spring.
struct WallStretch {
  double cut_m = 0;
  double attracted_m = 0;
  double rejection_m = 0;
  double stiffness_N_per_m = 0;  ///< K_t
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
  [[gnu::always_inline]] static double ahead(double x_m, double fading_m, const WallStretch& stretch) {
    return kLive ? x_m + std::min(stretch.attracted_m, fading_m) : x_m;
  }
};

/// Force along u: negative is cutting, positive is attracted. The wall is never behind the needle when
/// CUTTING is not live, and never ahead of it when ATTRACTED is not live.
template <class Cutting = CuttingStep<true>, class Attracted = AttractedStep<true>>
[[gnu::always_inline]] inline double applyTrackingWall(const SceneModel& model, SimState& state,
                                                       const Tick& tick, bool stop_begins,
                                                       const WallStretch& stretch, StepReport& report) {
  assert(state.slant > 0.0 && stretch.stiffness_N_per_m > 0.0);
  [[maybe_unused]] const Cutting cutting;
  [[maybe_unused]] const Attracted attracted;
  const double x = tick.x_cut_m;
  double wall = state.wall_m;
  // a stretched wall keeps the rejection force; a compressed one would pull the needle in
  if (state.stopped)
    wall = relaxedWall(model, state.wall_rest, wall, x, x > wall ? stretch.rejection_m : 0.0, stop_begins);
  const double ahead = attracted.ahead(x, std::max(0.0, tick.depth_m) * state.inverse_slant, stretch);
  const double behind = cutting.behind(x, stretch);
  wall = std::min(std::max(wall, behind), ahead);
  state.wall_m = wall;
  const double force = -stretch.stiffness_N_per_m * (x - wall);
  report.cutting_N = force < 0.0 ? force : 0.0;
  report.attracted_N = force < 0.0 ? 0.0 : force;
  return force;
}

/// The axial model of step_live.h for ENHANCED_TRACKING_WALL and TRACKING_WALL: the tip's layer sets the
/// stretches.
struct LayeredWall {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  static constexpr bool kHasWall = true;
  static constexpr bool kRelaxes = true;

  template <EffectMask Live, class Steps>
  [[gnu::always_inline]] static double apply(const SceneModel& model, SimState& state, const Tick& tick,
                                             bool stop_begins, StepReport& report) {
    using Cutting = typename Steps::template Cutting<(Live & bitOf(Effect::kCutting)) != 0>;
    using Attracted = typename Steps::template Attracted<(Live & bitOf(Effect::kAttracted)) != 0>;
    const CompiledLayer& layer = *tick.layer;
    if (layer.wall_stiffness_N_per_m != state.wall_stiffness_N_per_m) [[unlikely]]
      changeStiffness(state, tick.x_cut_m, layer.wall_stiffness_N_per_m);
    return applyTrackingWall<Cutting, Attracted>(model, state, tick, stop_begins,
                                                 {layer.cut_stretch_m, layer.attracted_stretch_m,
                                                  layer.rejection_stretch_m, layer.wall_stiffness_N_per_m},
                                                 report);
  }
};

}  // namespace needlelab
