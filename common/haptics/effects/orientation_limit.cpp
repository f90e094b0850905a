#include "haptics/effects/orientation_limit.h"

#include "haptics/det_math.h"

namespace needlelab {

void followTurn(const SceneModel& model, SimState& state, Vec3 axis_W, Vec3 u_before_W) noexcept {
  const double rise = angleBetween(axis_W, state.u_W) - angleBetween(axis_W, u_before_W);
  if (rise <= 0.0) return;
  state.tilt_limit_rad = tiltLimit(model, state) + rise;
  state.tilt_limit_is_cone = false;
}

Vec3 tiltOutsideCone(const SceneModel& model, SimState& state, const Tick& tick, Vec3 axis_cross_u,
                     double insertion_m, StepReport& report) noexcept {
  const double sine = norm(axis_cross_u);
  const double tilt = detAtan2(sine, dot(tick.axis_W, state.u_W));
  const double cone = orientationLimitAngle(model.needle_length_m, insertion_m);
  const double limit = std::max(cone, std::min(tiltLimit(model, state), tilt));
  state.tilt_limit_rad = limit;
  state.tilt_limit_is_cone = false;
  if (tilt <= limit || sine < 1e-9) return {};
  report.flags |= kFlagTorque;
  const double torque =
      std::min(model.orientation.stiffness_Nm_per_rad * (tilt - limit), model.orientation.max_torque_Nm);
  return axis_cross_u * (torque / sine);
}

}  // namespace needlelab
