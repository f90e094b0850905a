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

/// The torque of a needle outside the cone, and θ_l ← max(α, min(θ_l, θ)). Apart, because it needs angles.
Vec3 tiltOutsideCone(const SceneModel& model, SimState& state, const Tick& tick, Vec3 axis_cross_u,
                     double insertion_m, StepReport& report) noexcept;

/// Torque about the tip, in W.
inline Vec3 applyOrientationLimit(const SceneModel& model, SimState& state, const Tick& tick,
                                  StepReport& report) {
  const double length = model.needle_length_m;
  const double insertion = std::min(tick.insertion_m, length);  // d_t is never negative
  const Vec3 across = cross(tick.axis_W, state.u_W);
  const double along = dot(tick.axis_W, state.u_W);
  // θ > α, as tan θ > (L − d)/(L + d) with both sides squared
  const double opposite = normSquared(across) * (length + insertion) * (length + insertion);
  const double adjacent = along * (length - insertion);
  if (along > 0.0 && opposite <= adjacent * adjacent) [[likely]] {
    state.tilt_limit_is_cone = true;
    state.tilt_limit_insertion_m = insertion;
    return {};
  }
  return tiltOutsideCone(model, state, tick, across, insertion, report);
}

}  // namespace needlelab
