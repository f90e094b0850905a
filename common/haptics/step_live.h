/// One tick of DESIGN §3 as a template over the axial model and the set of live effects. For the models'
/// files only: others call `step` of engine.h.
#pragma once

#include <cstddef>
#include <limits>
#include <utility>

#include "haptics/contact.h"
#include "haptics/effects/clamping.h"
#include "haptics/effects/orientation_limit.h"
#include "haptics/effects/puncture.h"
#include "haptics/effects/shaft_friction.h"
#include "haptics/effects/tracking_wall.h"
#include "haptics/models/axial_entry.h"

namespace needlelab {

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// position along u since the tick before entry; the shift of turns is taken out of what is kept
inline double& keptPosition(SimState& state, std::uint64_t tick) {
  return state.x_history_m[tick & (kHistoryCapacity - 1)];
}

// v = (x_k − x_{k−j})/(jT), j = min(100 ms, ticks since the one before entry)
inline double updateSpeed(const SceneModel& model, SimState& state, double x_m) {
  const std::uint64_t now = ++state.ticks_inside;
  const std::uint64_t back = now < model.speed_window ? now : model.speed_window;
  const double kept = x_m - state.x_shift_m;
  keptPosition(state, now) = kept;
  return (kept - keptPosition(state, now - back)) / (static_cast<double>(back) * model.period_s);
}

// contact: false when the tip is not in tissue, or is but has never been outside; no force then
inline bool updateContact(const SceneModel& model, SimState& state, const Tick& tick, StepReport& report) {
  if (tick.depth_m <= 0.0) {
    if (state.inside) {
      endInsertion(state);
      report.flags |= kFlagExit;
    }
    state.outside_once = true;
    return false;
  }
  if (!state.outside_once) {
    report.flags |= kFlagStartedInside;
    return false;
  }
  if (!state.inside) [[unlikely]] {
    beginInsertion(model, state, tick);
    report.flags |= kFlagEntry;
  }
  return true;
}

inline void remember(SimState& state, const Tick& tick) {
  state.p_prev_W_m = tick.p_W_m;
  state.depth_prev_m = tick.depth_m;
  state.has_prev = true;
}

/// One tick with the effects of `Live` compiled in and the others not there at all: what a scene does not ask
/// for costs nothing. `Axial` gives the force along u:
///   static constexpr bool acts(EffectMask live);  // whether it is live at all
///   static constexpr bool kHasWall;               // state.wall_m is a place on the trajectory, to be
///   reported static double apply(model, state, tick, stop_begins, report);  // fills report.cutting_N or
///   attracted_N
/// What it keeps from tick to tick lies in SimState: a place along u as `wall_m` (0 at entry, a turn of u
/// moves it), or less `x_shift_m`, which a turn changes instead.
template <class Axial, EffectMask Live>
void stepLive(const SceneModel& model, const TipSample& sample, SimState& state,
              StepReport& report) noexcept {
  constexpr auto live = [](Effect effect) { return (Live & bitOf(effect)) != 0; };

  // input
  report = StepReport{};
  report.p_wall_W_m = {kNoNumber, kNoNumber, kNoNumber};
  if (!isFinite(sample.p_WT_m) || !isFinite(sample.q_WT)) [[unlikely]] {
    report.flags = kFlagNotStepped;
    return;
  }
  Tick tick;
  tick.p_W_m = sample.p_WT_m;
  tick.depth_m = report.depth_m = signedDepth(model.limb, tick.p_W_m);
  tick.axis_W = zAxis(sample.q_WT);
  tick.axis_W = normalized(tick.axis_W);

  // contact
  if (!updateContact(model, state, tick, report)) {
    remember(state, tick);
    return;
  }
  const bool entry = state.ticks_inside == 0;
  const std::uint32_t layer_before = state.layer;
  state.layer = layerAt(model, tick.depth_m, state.layer);
  if (!entry && state.layer != layer_before) report.flags |= kFlagLayerChange;

  // trajectory and clamping
  tick.arm_W_m = tick.p_W_m - state.p_entry_W_m;
  project(state, tick);
  Vec3 clamping_W;
  if constexpr (live(Effect::kClamping)) clamping_W = applyClamping(model, state, tick, report);

  // speed
  const double x_before = entry ? 0.0 : keptPosition(state, state.ticks_inside) + state.x_shift_m;
  tick.speed_mps = updateSpeed(model, state, tick.x_m);
  const bool stop_begins = updatePhase(model, state, tick.speed_mps);

  // membranes and ruptures
  double membranes_N = 0.0;
  tick.x_cut_m = tick.x_m;
  if constexpr (live(Effect::kPuncture))
    membranes_N = applyMembranes(model, state, tick, x_before, entry ? 0.0 : state.depth_prev_m, report);
  else
    (void)x_before;

  // along u: axial, friction, puncture
  double along_N = 0.0;
  if constexpr (Axial::acts(Live)) {
    along_N = Axial::apply(model, state, tick, stop_begins, report);
    if constexpr (Axial::kHasWall) report.p_wall_W_m = state.p_entry_W_m + state.u_W * state.wall_m;
  } else {
    (void)stop_begins;
  }
  if constexpr (live(Effect::kShaftFriction)) along_N += applyShaftFriction(model, state, tick, report);
  if constexpr (live(Effect::kPuncture)) along_N += membranes_N;

  // orientation limit
  if constexpr (live(Effect::kOrientationLimit))
    report.wrench_W.torque_Nm = applyOrientationLimit(model, state, tick, report);

  // sum, capped
  Vec3 force = state.u_W * along_N + clamping_W;
  const double squared = normSquared(force);
  if (squared > model.max_force_N * model.max_force_N) {
    force = force * (model.max_force_N / std::sqrt(squared));
    report.flags |= kFlagForceCapped;
  }
  report.wrench_W.force_N = force;

  // report
  report.phase = state.phase;
  report.layer = static_cast<std::int32_t>(state.layer);
  report.insertion_m = tick.insertion_m;
  report.speed_mps = tick.speed_mps;
  report.lateral_error_m = tick.lateral_m;
  if (tick.insertion_m > model.needle_length_m) report.flags |= kFlagBeyondNeedle;
  remember(state, tick);
}

/// The step functions of an axial model, one per EffectMask.
template <class Axial>
constexpr StepTable stepTable() {
  return []<std::size_t... Masks>(std::index_sequence<Masks...>) {
    return StepTable{&stepLive<Axial, static_cast<EffectMask>(Masks)>...};
  }
  (std::make_index_sequence<kAllEffects + 1>());
}

}  // namespace needlelab
