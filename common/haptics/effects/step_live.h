/// One tick (FORCE_MODEL.md) as a template over the axial model and the set of live effects. Only the models'
/// files include it; all other code calls `step` of engine.h.
#pragma once

#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "common/haptics/effects/clamping.h"
#include "common/haptics/effects/hub.h"
#include "common/haptics/effects/orientation_limit.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/effects/shaft_friction.h"
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/tick.h"

namespace needlelab {

/// v = (x_k − x_{k−j})/(jT), j = min(100 ms, ticks since the tick before entry).
[[gnu::always_inline]] inline double updateSpeed(const SceneModel& model, SimState& state, double x_m) {
  assert(state.history_mask == model.history_mask && "a state belongs to one model");
  const std::uint64_t now = ++state.ticks_inside;
  const double kept = x_m - state.x_shift_m;
  state.x_history_m[now & model.history_mask] = kept;
  if (now >= model.speed_window) [[likely]]
    return (kept - state.x_history_m[(now - model.speed_window) & model.history_mask]) / model.speed_window_s;
  return (kept - state.x_history_m[0]) / (static_cast<double>(now) * model.period_s);
}

/// The code of the effects with a fixed place in a tick. A test of their cost substitutes other types.
struct EffectSteps {
  template <bool kLive>
  using Cutting = CuttingStep<kLive>;
  template <bool kLive>
  using Attracted = AttractedStep<kLive>;
  template <bool kLive>
  using Clamping = ClampingStep<kLive>;
  template <bool kLive>
  using OrientationLimit = OrientationLimitStep<kLive>;
  template <bool kLive>
  using ShaftFriction = ShaftFrictionStep<kLive>;
  template <bool kLive>
  using Puncture = PunctureStep<kLive>;
};

/// True for an axial model with an `apply` that is a template over the live effects and their code.
template <class Axial, EffectMask Live, class Steps>
concept KnowsLive = requires(const SceneModel& model, SimState& state, const Tick& tick, StepReport& report) {
  Axial::template apply<Live, Steps>(model, state, tick, true, report);
};

/// The effects that an axial model replaces with its own: a scene that lists them is refused.
template <class Axial>
constexpr EffectMask replacedBy() {
  if constexpr (requires { Axial::kReplaces; })
    return Axial::kReplaces;
  else
    return 0;
}

/// True for an axial model whose wall relaxes in a stop.
template <class Axial>
constexpr bool relaxes() {
  if constexpr (requires { Axial::kRelaxes; })
    return Axial::kRelaxes;
  else
    return false;
}

/// One tick with the effects of `Live` compiled in and the others absent: unused effects cost nothing.
/// `Axial` gives the force along u:
///   static constexpr EffectMask kRenders;   // the effects of CUTTING and ATTRACTED that it can render
///   static constexpr EffectMask kReplaces;  // optional: the effects that it replaces with its own
///   static constexpr bool kHasWall;  // state.wall_m is a place on the trajectory, to be reported
///   static constexpr bool kRelaxes;  // optional: that wall relaxes in a stop
///   static double apply(model, state, tick, stop_begins, report);
///     // fills report.cutting_N or attracted_N, which are initially 0 (as are friction_N and puncture_N when
///     // that effect is not live). If it is a template over the EffectMask, it writes both
/// The model keeps its state in SimState: a place along u either as `wall_m` (0 at entry, a turn of u moves
/// it), or with `x_shift_m` subtracted, which a turn changes instead.
///
/// The common tick runs straight through; rare events (start or end of contact, another layer, a turn, a
/// tilted needle) are handled out of line on a copy of `tick`, so that the compiler can keep the original in
/// registers. Nothing of the report is written twice.
template <class Axial, EffectMask Live, class Steps = EffectSteps>
void stepLive(const SceneModel& model, const TipSample& sample, SimState& state,
              StepReport& report) noexcept {
  constexpr auto live = [](Effect effect) { return (Live & bitOf(effect)) != 0; };
  constexpr bool kActs = (Live & Axial::kRenders) != 0;
  typename Steps::template Clamping<live(Effect::kClamping)> clamping;
  typename Steps::template OrientationLimit<live(Effect::kOrientationLimit)> orientation;
  typename Steps::template ShaftFriction<live(Effect::kShaftFriction)> friction;
  typename Steps::template Puncture<live(Effect::kPuncture)> membranes;

  assert(state.layer < model.layer_count);
  assert((!state.in_limb || state.inside) && (!state.inside || state.outside_once));

  // input: depth and axis are finite only if the whole pose is finite
  Tick tick;
  tick.depth_m = depthIn(model, sample.p_WT_m);
  const double pose_size = orientation.readPose(sample);
  [[maybe_unused]] const Vec3 axis_W = zAxis(sample.q_WT);

  // contact: quick path if the tip is in the same layer as before
  bool entry = false;
  tick.layer = &model.layers[state.layer];
  report.flags = 0;
  if (!(state.in_limb && tick.depth_m < tick.layer->bottom_m && tick.depth_m >= tick.layer->min_depth_m &&
        pose_size <= std::numeric_limits<double>::max())) [[unlikely]] {
    if (!changeContact(model, sample, tick.depth_m, state, report)) return;
    entry = (report.flags & kFlagEntry) != 0;
    tick.layer = state.in_limb ? &model.layers[state.layer] : &model.beyond;
  }

  assert(state.inside && isUnit(state.u_W) && isUnit(state.u0_W) && isUnit(state.normal_W));
  assert(state.slant > 0.0 && !(state.slant > 1 + 1e-8));

  // trajectory and clamping
  project(state, sample.p_WT_m, tick);
  followMiddle(model, tick, state);
  // P0's distance from the line, along the skin, is at most e/c
  if (!(tick.lateral_m * state.inverse_slant <= kSlack * (tick.depth_m - kFollow_m))) [[unlikely]] {
    const Follow follow = followNearSkin(model, sample, tick, state);
    if (follow == Follow::kDeeper) report.flags |= kFlagTurn;
    if (follow != Follow::kStays) project(state, sample.p_WT_m, tick);
  }
  FixturePull pull;
  if constexpr (live(Effect::kClamping)) {
    followAxis(model, axis_W, state);
    pull = clamping.apply(model, sample, state, tick, report);
  } else {
    clamping.clear(report);
  }

  // orientation limit, because u may have turned
  orientation.apply(model, state, tick.insertion_m, report);

  // speed
  membranes.rememberPlace(model, state, entry);
  tick.speed_mps = updateSpeed(model, state, tick.x_m);

  // membranes and ruptures
  tick.x_cut_m = tick.x_m;
  [[maybe_unused]] const double membranes_N = membranes.apply(model, state, tick, entry, report);

  // stop and phase, after ruptures have moved the wall
  [[maybe_unused]] const bool stop_begins =
      updatePhase < kActs && relaxes<Axial>() > (model, state, sample.p_WT_m, tick);

  // forces along u: axial, friction, puncture
  double along_N = 0.0;
  friction.clear(report);
  if constexpr (!kActs) {
    report.cutting_N = report.attracted_N = 0.0;
  } else if constexpr (KnowsLive<Axial, Live, Steps>) {
    along_N = Axial::template apply<Live, Steps>(model, state, tick, stop_begins, report);
  } else {
    report.cutting_N = report.attracted_N = 0.0;
    along_N = Axial::apply(model, state, tick, stop_begins, report);
  }
  if constexpr (kActs && Axial::kHasWall)
    report.p_wall_W_m = state.p_entry_W_m + state.u_W * state.wall_m;
  else
    report.p_wall_W_m = {kNoNumber, kNoNumber, kNoNumber};
  if constexpr (live(Effect::kShaftFriction))
    along_N += friction.apply(model, state, tick, stop_begins, report);
  if constexpr (live(Effect::kPuncture)) along_N += membranes_N;

  assert(!(report.cutting_N > 0.0) && !(report.attracted_N < 0.0));

  // sum, capped
  // the cap needs no vector length while the sum of the magnitudes is below it
  Vec3 force;
  double max_N = std::fabs(along_N);
  if constexpr (live(Effect::kClamping)) {
    force = state.u_W * (along_N + pull.line_N_per_m * tick.x_m) -
            tick.arm_W_m * (pull.line_N_per_m + pull.entry_N_per_m);
    max_N += mostOf(pull, tick);
  } else {
    force = state.u_W * along_N;
  }
  if (tick.insertion_m > model.needle_length_m) [[unlikely]] {
    force = force + pressHub(model, tick.arm_W_m, tick.insertion_m, report);
    max_N += report.hub_N;
  }
  if (!(max_N <= model.surely_below_cap_N)) [[unlikely]]
    capForce(model, force, report);
  report.wrench_W.force_N = force;

  // report: this square root is only for the report, and here it delays nothing
  if constexpr (live(Effect::kClamping)) report.clamping_N = magnitudeOf(pull, tick);
  assert(state.phase != Phase::kFree);
  report.phase = state.phase;
  report.layer = static_cast<std::int32_t>(state.layer);
  report.depth_m = tick.depth_m;
  report.insertion_m = tick.insertion_m;
  report.speed_mps = tick.speed_mps;
  report.lateral_error_m = tick.lateral_m;
  state.p_prev_W_m = sample.p_WT_m;
  state.depth_prev_m = tick.depth_m;
}

/// The step functions of an axial model: one for each set of live effects that a scene of this model can
/// have (the index is that set), null for the others. They do not contain stages (`stepWithStages`).
using StepTable = std::array<StepFunction, kPlacedEffects + 1>;

template <class Axial, class Steps = EffectSteps>
constexpr StepTable stepTable() {
  constexpr EffectMask kWall = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  constexpr EffectMask kNever = (kWall & ~Axial::kRenders) | replacedBy<Axial>();
  return []<std::size_t... Masks>(std::index_sequence<Masks...>) {
    const auto one = []<EffectMask Live>() -> StepFunction {
      if constexpr ((Live & kNever) != 0)
        return nullptr;
      else
        return &stepLive<Axial, Live, Steps>;
    };
    return StepTable{one.template operator()<static_cast<EffectMask>(Masks)>()...};
  }
  (std::make_index_sequence<kPlacedEffects + 1>());
}

}  // namespace needlelab
