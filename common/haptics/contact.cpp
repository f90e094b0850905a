#include "haptics/contact.h"

#include <algorithm>

#include "haptics/det_math.h"

namespace needlelab {
namespace {

constexpr double kSin10Degrees = 0.17364817766693034885;

// the unit surface normal out of the tissue at a surface point; where the shape has none (a centre), against
// the motion
Vec3 normalAt(const Limb& limb, Vec3 p, Vec3 motion) {
  Vec3 out;
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) {
    return plane->normal;
  } else if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    out = p - sphere->center_m;
  } else {
    const auto& capsule = *std::get_if<CapsuleLimb>(&limb);
    const Vec3 ab = capsule.b_m - capsule.a_m;
    const double t = std::clamp(dot(p - capsule.a_m, ab) / normSquared(ab), 0.0, 1.0);
    out = p - (capsule.a_m + ab * t);
  }
  const double size = norm(out);
  return size > 1e-12 ? out / size : -normalized(motion);
}

}  // namespace

void beginInsertion(const SceneModel& model, SimState& state, const Tick& tick) noexcept {
  const Vec3 motion = tick.p_W_m - state.p_prev_W_m;
  const double share = state.depth_prev_m / (state.depth_prev_m - tick.depth_m);
  state.inside = true;
  state.p_entry_W_m = state.p_prev_W_m + motion * share;
  state.normal_W = normalAt(model.limb, state.p_entry_W_m, motion);
  const bool points_in = dot(tick.axis_W, -state.normal_W) > kSin10Degrees;
  state.u_W = state.u0_W = points_in ? tick.axis_W : -state.normal_W;
  state.slant = std::max(0.05, -dot(state.normal_W, state.u_W));
  state.inverse_slant = 1.0 / state.slant;
  state.layer = state.layer_by_length = 0;
  state.phase = Phase::kInserting;

  state.ticks_inside = 0;
  state.x_shift_m = 0.0;
  state.x_history_m[0] = 0.0;
  state.wall_m = state.friction_wall_m = 0.0;
  state.stopped = false;
  state.slow_ticks = 0;
  state.stop_step_m = state.stop_stretch_m = 0.0;
  state.dead_radius_m = state.k_prev_N_per_m = state.e_prev_m = 0.0;
  state.membranes_met = state.membranes_ruptured = 0;
  state.tilt_limit_is_cone = false;
  if (model.isLive(Effect::kOrientationLimit))
    state.tilt_limit_rad = std::max(kPi / 4, angleBetween(tick.axis_W, state.u_W));
}

void endInsertion(SimState& state) noexcept {
  state.inside = false;
  state.phase = Phase::kFree;
}

}  // namespace needlelab
