/// Clamping force: a virtual fixture toward the trajectory line, stiffer with depth (paper eq. 8;
/// FORCE_MODEL.md, "Clamping").
#pragma once

#include <cassert>
#include <cmath>

#include "common/haptics/effects/trajectory.h"

namespace needlelab {

/// The fixture's force in W is −line·e − entry·(p − P0).
struct FixturePull {
  double line_N_per_m = 0;   ///< toward the line
  double entry_N_per_m = 0;  ///< toward P0
};

/// The pull of a fixture that holds the tip with k times `stretch_m` (at most |e|): eq. 8, and in
/// CONSERVATIVE mode also ½ k′ stretch² toward P0. It is −∇U for U = ½ k(d_t) e², linear in e beyond the
/// maximum force. The tip must not be at P0.
[[gnu::always_inline]] inline FixturePull fixturePull(const SceneModel& model, const Tick& tick,
                                                      double line_N_per_m, double slope_N_per_m2,
                                                      double stretch_m) {
  assert(tick.insertion_m > 0.0);
  return {line_N_per_m,
          model.fixture_push * slope_N_per_m2 * (stretch_m * stretch_m) * tick.inverse_insertion_per_m};
}

/// An upper bound of the clamping force's magnitude.
[[gnu::always_inline]] inline double mostOf(const FixturePull& pull, const Tick& tick) {
  return pull.line_N_per_m * tick.lateral_m + pull.entry_N_per_m * tick.insertion_m;
}

/// The clamping force's magnitude: e·(p − P0) = |e|².
[[gnu::always_inline]] inline double magnitudeOf(const FixturePull& pull, const Tick& tick) {
  const double line_N = pull.line_N_per_m * tick.lateral_m, entry_N = pull.entry_N_per_m * tick.insertion_m;
  return std::sqrt(line_N * (line_N + 2.0 * pull.entry_N_per_m * tick.lateral_m) + entry_N * entry_N);
}

/// Returns the clamping force's pull and writes k and the flags into the report. May turn u: compute
/// everything that depends on u afterwards.
[[gnu::always_inline]] inline FixturePull applyClamping(const SceneModel& model, const TipSample& sample,
                                                        SimState& state, Tick& tick, StepReport& report) {
  LateralStiffness of = lateralStiffness(state.along, tick.insertion_m);
  double force_N = of.k_N_per_m * tick.lateral_m;
  double line_N_per_m = of.k_N_per_m, stretch_m = tick.lateral_m;
  const bool may_turn = !isWithinTurn(model, tick) && dot(state.aim_W, tick.lateral_W_m) > 0.0;
  if (may_turn || !(force_N <= model.fixture.max_force_N)) [[unlikely]] {
    if (may_turn && turnTrajectory(model, sample, state)) report.flags |= kFlagTurn;
    project(state, sample.p_WT_m, tick);
    of = lateralStiffness(state.along, tick.insertion_m);
    force_N = of.k_N_per_m * tick.lateral_m;
    line_N_per_m = of.k_N_per_m;
    stretch_m = tick.lateral_m;
    if (force_N > model.fixture.max_force_N) {
      line_N_per_m = model.fixture.max_force_N / tick.lateral_m;
      stretch_m = model.fixture.max_force_N / of.k_N_per_m;
      report.flags |= kFlagClampCapped;
    }
  }
  report.clamping_stiffness_N_per_m = of.k_N_per_m;
  if (!(force_N > 0.0)) [[unlikely]]
    return {};
  return fixturePull(model, tick, line_N_per_m, of.slope_N_per_m2, stretch_m);
}

/// The effect's place in a tick.
template <bool kLive>
struct ClampingStep {
  [[gnu::always_inline]] static FixturePull apply(const SceneModel& model, const TipSample& sample,
                                                  SimState& state, Tick& tick, StepReport& report) {
    return applyClamping(model, sample, state, tick, report);
  }
  /// Runs instead of `apply` when the effect is not live.
  [[gnu::always_inline]] static void clear(StepReport& report) {
    report.clamping_N = report.clamping_stiffness_N_per_m = 0.0;
  }
};

}  // namespace needlelab
