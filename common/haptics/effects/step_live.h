/// One tick of DESIGN §3 as a template over the axial model and the set of live effects. For the models'
/// files only: others call `step` of engine.h.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "common/haptics/contact.h"
#include "common/haptics/effects/clamping.h"
#include "common/haptics/effects/orientation_limit.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/effects/shaft_friction.h"
#include "common/haptics/effects/tracking_wall.h"

namespace needlelab {

/// v = (x_k − x_{k−j})/(jT), j = min(100 ms, ticks since the one before entry).
[[gnu::always_inline]] inline double updateSpeed(const SceneModel& model, SimState& state, double x_m) {
  const std::uint64_t now = ++state.ticks_inside;
  const double kept = x_m - state.x_shift_m;
  state.x_history_m[now & model.history_mask] = kept;
  if (now >= model.speed_window) [[likely]]
    return (kept - state.x_history_m[(now - model.speed_window) & model.history_mask]) / model.speed_window_s;
  return (kept - state.x_history_m[0]) / (static_cast<double>(now) * model.period_s);
}

/// Cut to max_force_N, the direction kept.
inline void capForce(const SceneModel& model, Vec3& force_N, StepReport& report) {
  const double squared = normSquared(force_N);
  if (!(squared > model.max_force_N * model.max_force_N)) return;
  force_N = force_N * (model.max_force_N / std::sqrt(squared));
  report.flags |= kFlagForceCapped;
}

/// An axial model whose `apply` is a template over the live effects.
template <class Axial, EffectMask Live>
concept KnowsLive = requires(const SceneModel& model, SimState& state, const Tick& tick, StepReport& report) {
  Axial::template apply<Live>(model, state, tick, true, report);
};

/// One tick with the effects of `Live` compiled in and the others not there at all: what a scene does not ask
/// for costs nothing. `Axial` gives the force along u:
///   static constexpr bool acts(EffectMask live);  // whether it is live at all
///   static constexpr bool kHasWall;  // state.wall_m is a place on the trajectory, to be reported
///   static double apply(model, state, tick, stop_begins, report);
///     // fills report.cutting_N or attracted_N, which are 0 before (so are friction_N and puncture_N where
///     // that effect is not live). Where it is a template over the EffectMask, it writes both
/// What it keeps from tick to tick lies in SimState: a place along u as `wall_m` (0 at entry, a turn of u
/// moves it), or less `x_shift_m`, which a turn changes instead.
///
/// The common tick runs straight through; what is rare (contact that begins or ends, another layer, a turn, a
/// tilted needle) is called out of line and works on a copy of `tick`, so that the compiler can keep the
/// original in registers. Nothing of the report is written twice.
template <class Axial, EffectMask Live>
void stepLive(const SceneModel& model, const TipSample& sample, SimState& state,
              StepReport& report) noexcept {
  constexpr auto live = [](Effect effect) { return (Live & bitOf(effect)) != 0; };

  // input: depth and axis are finite only where all of the pose is
  Tick tick;
  tick.depth_m = depthIn(model, sample.p_WT_m);
  [[maybe_unused]] RawAxis raw;
  double pose_size;
  if constexpr (live(Effect::kOrientationLimit)) {
    raw.axis_W = zAxis(sample.q_WT);
    raw.squared = pose_size = normSquared(raw.axis_W);
  } else {
    pose_size = dot(sample.q_WT, sample.q_WT);
  }

  // contact: in the tissue and in the same layer as before, or else a second look
  bool entry = false;
  tick.layer = &model.layers[state.layer];
  report.flags = 0;
  if (!(state.inside && tick.depth_m < tick.layer->bottom_m && tick.depth_m >= tick.layer->least_depth_m &&
        pose_size <= std::numeric_limits<double>::max())) [[unlikely]] {
    if (!changeContact(model, sample, tick.depth_m, state, report)) return;
    entry = (report.flags & kFlagEntry) != 0;
    tick.layer = &model.layers[state.layer];
  }

  // trajectory and clamping
  project(state, sample.p_WT_m, tick);
  Vec3 clamping_W;
  if constexpr (live(Effect::kClamping)) {
    clamping_W = applyClamping(model, sample, state, tick, report);
  } else {
    report.clamping_N = report.clamping_stiffness_N_per_m = 0.0;
  }

  // orientation limit: after u may have turned
  if constexpr (live(Effect::kOrientationLimit))
    applyOrientationLimit(model, state, raw, tick.insertion_m, report);
  else
    report.wrench_W.torque_Nm = {};

  // speed
  [[maybe_unused]] double x_before_m = 0.0;
  if constexpr (live(Effect::kPuncture))
    if (!entry) x_before_m = state.x_history_m[state.ticks_inside & model.history_mask] + state.x_shift_m;
  tick.speed_mps = updateSpeed(model, state, tick.x_m);
  [[maybe_unused]] const bool stop_begins = updatePhase(model, state, tick.speed_mps);

  // membranes and ruptures
  double membranes_N = 0.0;
  tick.x_cut_m = tick.x_m;
  if constexpr (live(Effect::kPuncture))
    membranes_N = applyMembranes(model, state, tick, x_before_m, entry ? 0.0 : state.depth_prev_m, report);
  else
    report.puncture_N = 0.0;

  // along u: axial, friction, puncture
  double along_N = 0.0;
  if constexpr (!live(Effect::kShaftFriction)) report.friction_N = 0.0;
  if constexpr (!Axial::acts(Live)) {
    report.cutting_N = report.attracted_N = 0.0;
  } else if constexpr (KnowsLive<Axial, Live>) {
    along_N = Axial::template apply<Live>(model, state, tick, stop_begins, report);
  } else {
    report.cutting_N = report.attracted_N = 0.0;
    along_N = Axial::apply(model, state, tick, stop_begins, report);
  }
  if constexpr (Axial::acts(Live) && Axial::kHasWall)
    report.p_wall_W_m = state.p_entry_W_m + state.u_W * state.wall_m;
  else
    report.p_wall_W_m = {kNoNumber, kNoNumber, kNoNumber};
  if constexpr (live(Effect::kShaftFriction)) along_N += applyShaftFriction(model, state, tick, report);
  if constexpr (live(Effect::kPuncture)) along_N += membranes_N;

  // sum, capped
  // the cap needs no length while the magnitudes together stay below it
  Vec3 force = state.u_W * along_N + clamping_W;
  const double magnitudes_N =
      live(Effect::kClamping) ? std::fabs(along_N) + report.clamping_N : std::fabs(along_N);
  if (!(magnitudes_N <= model.surely_below_cap_N)) [[unlikely]]
    capForce(model, force, report);
  report.wrench_W.force_N = force;

  // report
  report.phase = state.phase;
  report.layer = static_cast<std::int32_t>(state.layer);
  report.depth_m = tick.depth_m;
  report.insertion_m = tick.insertion_m;
  report.speed_mps = tick.speed_mps;
  report.lateral_error_m = tick.lateral_m;
  if (tick.insertion_m > model.needle_length_m) [[unlikely]]
    report.flags |= kFlagBeyondNeedle;
  state.p_prev_W_m = sample.p_WT_m;
  state.depth_prev_m = tick.depth_m;
}

/// One step function per set of live effects (its index is the EffectMask): an effect that is not live is not
/// compiled in.
using StepTable = std::array<StepFunction, kAllEffects + 1>;

/// The step functions of an axial model, one per EffectMask.
template <class Axial>
constexpr StepTable stepTable() {
  return []<std::size_t... Masks>(std::index_sequence<Masks...>) {
    return StepTable{&stepLive<Axial, static_cast<EffectMask>(Masks)>...};
  }
  (std::make_index_sequence<kAllEffects + 1>());
}

}  // namespace needlelab
