#include "common/haptics/effects/orientation_limit.h"

#include <array>
#include <cassert>

#include "common/haptics/det_math.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {

void followTurn(const SceneModel& model, SimState& state, Vec3 axis_W, Vec3 u0_before_W) noexcept {
  assert(isUnit(axis_W) && isUnit(u0_before_W));
  // θ did not rise if the cosine grew by more than rounding: the usual case, which needs no angles
  if (dot(axis_W, state.u0_W) > dot(axis_W, u0_before_W) + 1e-12) return;
  const double rise = angleBetween(axis_W, state.u0_W) - angleBetween(axis_W, u0_before_W);
  if (rise <= 0.0) return;
  state.tilt_limit_rad = tiltLimit(model, state) + rise;
  state.tilt_limit_is_cone = false;
}

void tiltNearCone(const SceneModel& model, SimState& state, double insertion_m, double axis_x, double axis_y,
                  double axis_z, StepReport& report) noexcept {
  assert(!(insertion_m > model.needle_length_m));
  report.wrench_W.torque_Nm = {};
  const Vec3 axis = normalized(Vec3{axis_x, axis_y, axis_z});
  const Vec3 across = cross(axis, state.u0_W);
  const double along = dot(axis, state.u0_W);

  // θ > α, as tan θ > (L − d)/(L + d) with both sides squared
  const double length = model.needle_length_m;
  const double across_squared = normSquared(across);
  const double opposite = across_squared * (length + insertion_m) * (length + insertion_m);
  const double adjacent = along * (length - insertion_m);
  if (along > 0.0 && opposite <= adjacent * adjacent) {
    state.tilt_limit_is_cone = true;
    state.tilt_limit_insertion_m = insertion_m;
    return;
  }

  const double sine = std::sqrt(across_squared);
  const double tilt = detAtan2Inline(sine, along);
  double limit = tiltLimit(model, state);
  if (tilt < limit) {
    limit = tilt;  // more than α here
    state.tilt_limit_insertion_m = insertion_m;
  } else if (insertion_m < state.tilt_limit_insertion_m) {
    // α falls with depth, so it can exceed θ_l only at a smaller depth than where θ_l ≥ α was last seen
    limit = std::max(limit, detAtan2Inline(length - insertion_m, length + insertion_m));
    state.tilt_limit_insertion_m = insertion_m;
  }
  assert(!(limit < 0.0));
  state.tilt_limit_rad = limit;
  state.tilt_limit_is_cone = false;
  if (tilt <= limit || sine < 1e-9) return;
  report.flags |= kFlagTorque;
  const double torque =
      std::min(model.orientation.stiffness_Nm_per_rad * (tilt - limit), model.orientation.max_torque_Nm);
  report.wrench_W.torque_Nm = across * (torque / sine);
  assert(!(norm(report.wrench_W.torque_Nm) > model.orientation.max_torque_Nm * (1 + 1e-9)));
}

namespace {

constexpr std::array<EffectField, 2> kTiltFields = {
    {{"stiffness_nm_per_rad",
      "Rotational stiffness",
      {0, 100},
      0.5,
      [](SceneSpec& spec) -> double& { return spec.orientation_limit.stiffness_Nm_per_rad; }},
     {"max_torque_nm", "Greatest torque", {0, 5}, 0.2, [](SceneSpec& spec) -> double& {
        return spec.orientation_limit.max_torque_Nm;
      }}}};

}  // namespace

extern const EffectEntry kOrientationLimitEntry;
constinit const EffectEntry kOrientationLimitEntry = {
    .effect = Effect::kOrientationLimit,
    .name = "ORIENTATION_LIMIT",
    .label = "Orientation limit: what resists tilting",
    .short_name = "orient",
    .term = "torque",
    .unit = "N·m",
    .along_u = false,
    .colour = 0x009E73,
    .place = 5,
    .value = [](const StepReport& report) { return norm(report.wrench_W.torque_Nm); },
    .section = "orientation_limit",
    .fields = kTiltFields,
    .hasNumbers =
        [](const SceneSpec& spec) {
          return spec.orientation_limit.stiffness_Nm_per_rad > 0 && spec.orientation_limit.max_torque_Nm > 0;
        },
    .on_device = {.words = "orientation limit",
                  .turning_Nm_per_rad =
                      [](const SceneSpec& spec) {
                        const OrientationLimitSpec& limit = spec.orientation_limit;
                        return limit.max_torque_Nm > 0 ? limit.stiffness_Nm_per_rad : 0.0;
                      }},
    .lower = [](SceneSpec& spec, double share) { spec.orientation_limit.stiffness_Nm_per_rad *= share; }};

}  // namespace needlelab
