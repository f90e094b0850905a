/// Orientation limit: the freedom to tilt shrinks as the needle goes in (paper eq. 7; DESIGN §3.4).
#pragma once

#include <algorithm>

#include "haptics/effects/tick.h"

namespace needlelab {

/// θ_l as a number; while the needle stays in the cone it is kept as "α at this depth", which costs no
/// trigonometry.
inline double tiltLimit(const SceneModel& model, const SimState& state) {
  return state.tilt_limit_is_cone ? orientationLimitAngle(model.needle_length_m, state.tilt_limit_insertion_m)
                                  : state.tilt_limit_rad;
}

/// A turn of u that raises θ raises θ_l by as much.
void followTurn(const SceneModel& model, SimState& state, Vec3 axis_W, Vec3 u_before_W) noexcept;

/// The exact test of the cone, with the axis of length 1, and what follows when the needle is outside of it:
/// torque about the tip in W, and θ_l ← max(α, min(θ_l, θ)). Apart, because it is rare and needs angles.
void tiltNearCone(const SceneModel& model, SimState& state, const Tick& tick, double insertion_m,
                  StepReport& report) noexcept;

/// Torque about the tip, in W, into the report.
[[gnu::always_inline]] inline void applyOrientationLimit(const SceneModel& model, SimState& state,
                                                         const Tick& tick, StepReport& report) {
  const double length = model.needle_length_m;
  const double insertion = std::min(tick.insertion_m, length);  // d_t is never negative
  const double along = dot(tick.axis_W, state.u_W);
  // tan θ ≤ (L − d)/(L + d) is cos² θ ≥ (L + d)²/(2 (L² + d²)). Cheap, but blunt where θ is small: a needle
  // that is not inside by a margin far above rounding gets the exact test
  constexpr double kMargin = 1.0 + 1e-12;
  const double sum = length + insertion;
  const double cosine = 2.0 * (along * along) * (length * length + insertion * insertion);
  if (along > 0.0 && cosine >= kMargin * tick.axis_squared * (sum * sum)) [[likely]] {
    state.tilt_limit_is_cone = true;
    state.tilt_limit_insertion_m = insertion;
    report.wrench_W.torque_Nm = {};
    return;
  }
  const Tick rare = tick;
  tiltNearCone(model, state, rare, insertion, report);
}

}  // namespace needlelab
