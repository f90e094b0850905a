#include "common/haptics/effects/clamping.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/haptics/det_math.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/orientation_limit.h"
#include "common/haptics/spec_checker.h"

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
class Cone {
 public:
  Cone(const SceneModel& model, const SimState& state, Vec3 arm_W_m, double depth_m)
      : model_(model), state_(state), arm_W_m_(arm_W_m), depth_m_(depth_m) {}

  [[nodiscard]] bool holds(const Turned& turned) {
    const double x = dot(turned.u_W, arm_W_m_);
    const double insertion = insertionOf(x, depth_m_, 1.0 / turned.slant);
    // tan ∠ ≤ (L − d)/(L + d) by a margin far above rounding: the usual case, without angles
    const double length = model_.needle_length_m, d = std::min(insertion, length);
    const double across = normSquared(cross(turned.u_W, state_.u0_W)) * (length + d) * (length + d);
    const double along = dot(turned.u_W, state_.u0_W), adjacent = along * (length - d);
    if (along > 0.0 && across <= adjacent * adjacent * (1.0 - 1e-12)) return true;

    if (before_rad_ < 0.0) before_rad_ = angleBetween(state_.u_W, state_.u0_W);
    const double limit = std::max(orientationLimitAngle(length, insertion), before_rad_);
    return angleBetween(turned.u_W, state_.u0_W) <= limit;
  }

 private:
  const SceneModel& model_;
  const SimState& state_;
  Vec3 arm_W_m_;
  double depth_m_;
  double before_rad_ = -1.0;  // computed on demand
};

}  // namespace

bool turnTrajectory(const SceneModel& model, const TipSample& sample, SimState& state, double k_N_per_m,
                    Tick& tick) noexcept {
  project(state, sample.p_WT_m, tick);
  const Vec3 arm = sample.p_WT_m - state.p_entry_W_m;
  const double radius = norm(arm);
  const Vec3 side = tick.lateral_W_m / tick.lateral_m;
  const double kept_m = state.dead_radius_m + model.fixture.max_force_N / k_N_per_m;
  double angle = std::min(detAsin(tick.lateral_m / radius) - detAsin(kept_m / radius), model.max_turn_rad);
  if (!(angle > 0.0)) return false;

  // the greatest angle within the cone
  Cone cone(model, state, arm, tick.depth_m);
  Turned turned = turnedBy(angle, state, side);
  if (!cone.holds(turned)) {
    double allowed = 0.0, refused = angle;
    while (refused - allowed > kBisection_rad) {
      const double middle = 0.5 * (allowed + refused);
      (cone.holds(turnedBy(middle, state, side)) ? allowed : refused) = middle;
    }
    if (allowed == 0.0) return false;
    turned = turnedBy(allowed, state, side);
  }

  // all lengths along u move with it
  const double x_before = tick.x_m;
  const Vec3 u_before = state.u_W;
  state.u_W = turned.u_W;
  state.slant = turned.slant;
  state.inverse_slant = 1.0 / turned.slant;
  project(state, sample.p_WT_m, tick);
  const double shift = tick.x_m - x_before;
  state.wall_m += shift;
  state.friction_wall_m += shift;
  state.x_shift_m += shift;
  for (std::uint32_t i = 0; i < state.membranes_met; ++i) state.membrane_place_m[i] += shift;
  if (model.isLive(Effect::kOrientationLimit)) followTurn(model, state, unitAxis(sample), u_before);
  return true;
}

namespace {

constexpr std::array<EffectField, 2> kFixtureFields = {
    {{"max_stiffness_n_per_m", "Greatest stiffness", kStiffness, 400,
      [](SceneSpec& spec) -> double& { return spec.virtual_fixture.max_stiffness_N_per_m; }},
     {"max_force_n", "Greatest clamping force", kForce, 4,
      [](SceneSpec& spec) -> double& { return spec.virtual_fixture.max_force_N; }}}};
constexpr std::array<EffectChoice::Option, 2> kModes = {
    {{"PASSIVE", "Passive: never pushes the hand"}, {"PROPORTIONAL", "Proportional: as in the paper"}}};

}  // namespace

extern const EffectEntry kClampingEntry;
constinit const EffectEntry kClampingEntry = {
    .effect = Effect::kClamping,
    .name = "CLAMPING",
    .label = "Clamping: what keeps the needle on its line",
    .short_name = "clamp",
    .term = "clamping",
    .along_u = false,
    .colour = 0xCC79A7,
    .place = 4,
    .value = [](const StepReport& report) { return report.clamping_N; },
    .section = "virtual_fixture",
    .fields = kFixtureFields,
    .choice = {"mode", "Mode", kModes, "PASSIVE",
               [](SceneSpec& spec, int number) {
                 spec.virtual_fixture.mode = static_cast<ClampingMode>(number);
               }},
    .checkLayer =
        [](const LayerSpec& layer, SpecChecker& check) {
          check.number("lateral_stiffness_n_per_m2", layer.lateral_stiffness_N_per_m2, {0, 1e7});
        },
    .check =
        [](const SceneSpec& spec, SpecChecker& check) {
          const ClampingMode mode = spec.virtual_fixture.mode;
          check.require(mode == ClampingMode::kProportional || mode == ClampingMode::kPassive, "mode",
                        "is neither PROPORTIONAL nor PASSIVE");
        },
    .hasNumbers =
        [](const SceneSpec& spec) {
          return std::any_of(spec.layers.begin(), spec.layers.end(),
                             [](const LayerSpec& layer) { return layer.lateral_stiffness_N_per_m2 > 0; });
        }};

}  // namespace needlelab
