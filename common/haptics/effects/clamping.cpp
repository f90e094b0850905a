#include "haptics/effects/clamping.h"

#include <cmath>

#include "haptics/det_math.h"
#include "haptics/effects/orientation_limit.h"

namespace needlelab {
namespace {

constexpr double kBisection_rad = 1e-12;

// u after a turn by `angle` toward the side of the tip
struct Turned {
  Vec3 u_W;
  double slant;
};

Turned turnedBy(double angle_rad, const SimState& state, Vec3 side_W) {
  const Vec3 u = normalized(state.u_W * detCos(angle_rad) + side_W * detSin(angle_rad));
  return {u, std::max(0.05, -dot(state.normal_W, u))};
}

// the cone of the paper's Fig. 4: ∠(u, u0) ≤ max(α(d_t after the turn), ∠(u, u0) before)
bool withinCone(const Turned& turned, double before_rad, const SceneModel& model, const SimState& state,
                const Tick& tick) {
  const double x = dot(turned.u_W, tick.arm_W_m);
  const double insertion = insertionOf(x, tick.depth_m, 1.0 / turned.slant);
  const double limit = std::max(orientationLimitAngle(model.needle_length_m, insertion), before_rad);
  return angleBetween(turned.u_W, state.u0_W) <= limit;
}

}  // namespace

bool turnTrajectory(const SceneModel& model, const TipSample& sample, SimState& state, Tick& tick,
                    double k_N_per_m) noexcept {
  const double radius = norm(tick.arm_W_m);
  const Vec3 side = tick.lateral_W_m / tick.lateral_m;
  const double kept_m = state.dead_radius_m + model.fixture.max_force_N / k_N_per_m;
  double angle = std::min(detAsin(tick.lateral_m / radius) - detAsin(kept_m / radius), model.max_turn_rad);
  if (!(angle > 0.0)) return false;

  // the greatest angle that the cone allows
  const double before = angleBetween(state.u_W, state.u0_W);
  Turned turned = turnedBy(angle, state, side);
  if (!withinCone(turned, before, model, state, tick)) {
    double allowed = 0.0, refused = angle;
    while (refused - allowed > kBisection_rad) {
      const double middle = 0.5 * (allowed + refused);
      (withinCone(turnedBy(middle, state, side), before, model, state, tick) ? allowed : refused) = middle;
    }
    if (allowed == 0.0) return false;
    turned = turnedBy(allowed, state, side);
  }

  // what is measured along u moves with it
  const double x_before = tick.x_m;
  const Vec3 u_before = state.u_W;
  state.u_W = turned.u_W;
  state.slant = turned.slant;
  state.inverse_slant = 1.0 / turned.slant;
  project(state, tick);
  const double shift = tick.x_m - x_before;
  state.wall_m += shift;
  state.friction_wall_m += shift;
  state.x_shift_m += shift;
  for (std::uint32_t i = 0; i < state.membranes_met; ++i) state.membrane_place_m[i] += shift;
  if (model.isLive(Effect::kOrientationLimit)) followTurn(model, state, unitAxis(sample), u_before);
  return true;
}

double angleBetween(Vec3 a, Vec3 b) noexcept {
  return detAtan2(norm(cross(a, b)), dot(a, b));
}

}  // namespace needlelab
