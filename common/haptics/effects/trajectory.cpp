#include "common/haptics/effects/trajectory.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "common/haptics/det_math.h"
#include "common/haptics/effects/orientation_limit.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

constexpr double kSin80Degrees = 0.98480775301220805937;
constexpr double kBisection_rad = 1e-12;
/// A turn by less is none: rounding does not decide whether layers are laid again.
constexpr double kLeastTurn_rad = 1e-9;

// moves P0 and u, and all lengths along u with them
void moveLine(const SceneModel& model, const TipSample& sample, SimState& state, Vec3 p_entry_W_m,
              Vec3 normal_W, Vec3 u_W, Tick& tick) {
  assert(state.inside && isUnit(normal_W) && isUnit(u_W));
  assert(state.membranes_met <= model.membrane_count);
  const double x_before_m = tick.x_m;
  const bool turns = !(u_W == state.u_W);
  ++state.line_changes;
  state.p_entry_W_m = p_entry_W_m;
  if (turns || !model.is_plane) {
    state.normal_W = normal_W;
    state.u_W = u_W;
    state.slant = slantOf(normal_W, u_W);
    state.inverse_slant = 1.0 / state.slant;
  }
  project(state, sample.p_WT_m, tick);
  const double shift_m = tick.x_m - x_before_m;
  state.wall_m += shift_m;
  state.friction_wall_m += shift_m;
  // at an entry the springs are stretched by the tip's own way in the tissue, not by that of P0
  if (state.ticks_inside == 0) {
    const double way_m = dot(u_W, sample.p_WT_m - state.p_hole_W_m);
    state.wall_m = state.friction_wall_m = tick.x_m - std::max(0.0, std::min(tick.x_m, way_m));
  }
  state.x_shift_m += shift_m;
  for (std::uint32_t i = 0; i < state.membranes_met; ++i) state.membrane_place_m[i] += shift_m;
}

// `from` turned toward `to`, by at most an angle
Vec3 turnedToward(Vec3 from, Vec3 to, double max_rad) {
  const Vec3 aside = to - from * dot(from, to);
  if (!(normSquared(aside) > 1e-18)) return from;
  const double size = norm(aside);
  if (detAtan2(size, dot(from, to)) <= max_rad) return to;
  return normalized(from * detCos(max_rad) + aside * (detSin(max_rad) / size));
}

// how far the tip is beyond the top of a membrane's layer, along u
double beyondTop(const SceneModel& model, const SimState& state, const Tick& tick, std::size_t membrane) {
  return (tick.depth_m - model.membranes[membrane].top_m) * state.inverse_slant;
}

// P0 has moved to another hole: the membranes are whole there, and not stretched yet. The track of the old
// hole stays there
void pierceAgain(const SceneModel& model, const Tick& tick, SimState& state) {
  for (std::uint32_t left = state.membranes_ruptured; left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    state.membrane_place_m[i] = tick.x_m - std::min(0.0, beyondTop(model, state, tick, i));
  }
  state.membranes_ruptured = state.cuts.opened = 0;
  if (state.cuts.own < kMaxCutTracks) state.cuts.tracks[state.cuts.own].p_entry_W_m = state.p_hole_W_m;
  state.cuts.own = kMaxCutTracks;
  state.p_hole_W_m = state.p_entry_W_m;
}

// a wall follows a place that moves inward; ahead of it, where it pulls, it waits for it
double followed(double wall_m, double from_m, double to_m) {
  assert(!(to_m < from_m));
  return wall_m > from_m ? std::max(wall_m, to_m) : wall_m + (to_m - from_m);
}

// a membrane stays at the top of its layer when P0 moves along the skin; that only shortens its stretch. The
// walls that it holds back follow
void keepAtLayers(const SceneModel& model, const Tick& tick, SimState& state) {
  const double x_cut_before_m = cuttingPosition(state, tick.x_m);
  for (std::uint32_t left = intactMembranes(state); left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    const double beyond_m = beyondTop(model, state, tick, i);
    const double z_m = tick.x_m - state.membrane_place_m[i];
    const double kept_m = std::clamp(z_m, std::min(0.0, beyond_m), std::max(0.0, beyond_m));
    double& place_m = state.membrane_place_m[i];
    if (kept_m < z_m) place_m = std::max(place_m, tick.x_m - kept_m);
    if (kept_m > z_m) place_m = tick.x_m - kept_m;
  }
  const double x_cut_m = cuttingPosition(state, tick.x_m);
  state.wall_m = followed(state.wall_m, x_cut_before_m, x_cut_m);
  state.friction_wall_m = followed(state.friction_wall_m, x_cut_before_m, x_cut_m);
}

}  // namespace

Vec3 entryDirection(Vec3 axis_W, Vec3 normal_W) noexcept {
  assert(isUnit(axis_W) && isUnit(normal_W));
  const double inward = -dot(axis_W, normal_W);
  if (inward >= kCos80Degrees) return axis_W;
  const Vec3 aside = axis_W + normal_W * inward;
  if (inward <= -kCos80Degrees) return normalized(aside + normal_W * inward);
  return normalized(normalized(aside) * kSin80Degrees - normal_W * kCos80Degrees);
}

Follow followNearSkin(const SceneModel& model, const TipSample& sample, Tick tick, SimState& state) noexcept {
  assert(state.inside);
  // on the way out, use the skin on P0's side, otherwise the tangent plane at P0
  const double below_m = heightOf(model, state, tick);
  const double height_m = state.in_limb && !state.past_middle ? tick.depth_m : below_m;
  Vec3 u = state.u_W;
  if (height_m <= kFollow_m) {
    u = turnedToward(u, entryDirection(unitAxis(sample), state.normal_W), model.max_turn_rad);
    if (!(u == state.u0_W)) {
      const Vec3 u0_before_W = state.u0_W;
      state.u0_W = turnedToward(state.u0_W, u, model.max_turn_rad);
      if (model.isLive(Effect::kOrientationLimit)) followTurn(model, state, unitAxis(sample), u0_before_W);
    }
  }
  const double slack_m = kHole_m + kSlack * std::max(0.0, height_m - kFollow_m);
  const Vec3 off = tick.arm_W_m -
                   u * (below_m * (u == state.u_W ? state.inverse_slant : 1.0 / slantOf(state.normal_W, u)));
  const double off_m2 = normSquared(off);
  const bool deep = height_m > kFollow_m;
  const bool far = off_m2 > slack_m * slack_m;
  if (!far && u == state.u_W) return Follow::kStays;

  Vec3 p_entry = state.p_entry_W_m, normal = state.normal_W;
  if (far) {
    p_entry = p_entry + off * (1.0 - slack_m / std::sqrt(off_m2));
    if (deep) {
      // the fixture's energy may only fall: if it would rise, P0 waits
      const Vec3 arm = sample.p_WT_m - p_entry;
      const double before_J =
          fixtureEnergy(model, lateralStiffness(state.along, tick.insertion_m).k_N_per_m, tick.lateral_m);
      const double k = lateralStiffness(state.along, norm(arm)).k_N_per_m;
      if (fixtureEnergy(model, k, norm(arm - u * dot(u, arm))) > before_J) return Follow::kStays;
    }
    if (!model.is_plane && state.in_limb) {
      normal = surfaceNormal(model.limb, p_entry, u);
      p_entry = p_entry + normal * signedDepth(model.limb, p_entry);
    }
  }
  // deeper down, the needle keeps the layers through which it entered
  const bool same_layers = deep || (model.is_plane && u == state.u_W);
  moveLine(model, sample, state, p_entry, normal, u, tick);
  if (!same_layers) layLayers(model, state.p_entry_W_m, state.u_W, state.slant, state.along);
  if (far && model.isLive(Effect::kPuncture)) {
    const bool entry = state.ticks_inside == 0;
    if (!deep && !entry && normSquared(state.p_entry_W_m - state.p_hole_W_m) > kHoleWidth_m * kHoleWidth_m)
      pierceAgain(model, tick, state);
    keepAtLayers(model, tick, state);
  }
  return deep ? Follow::kDeeper : Follow::kNearSkin;
}

bool turnTrajectory(const SceneModel& model, const TipSample& sample, SimState& state) noexcept {
  Tick tick;
  project(state, sample.p_WT_m, tick);
  if (isWithinTurn(model, tick) || !(tick.x_m > 0.0)) return false;
  assert(tick.lateral_m > 0.0 && tick.insertion_m > 0.0);
  const Vec3 side = tick.lateral_W_m / tick.lateral_m;
  const double aside = dot(state.aim_W, side);
  if (!(aside > 0.0)) return false;
  // a tip that rests on bone moves with u: it is felt `held_m` before the place that u turns to
  const double share = tick.x_m / (tick.x_m + state.bone.held_m);
  const double beyond_rad =
      detAtan2(tick.lateral_m, tick.x_m) - detAtan2(turnTangent(model, tick.insertion_m), 1.0);
  double angle =
      std::min({beyond_rad * share, detAtan2(aside, dot(state.aim_W, state.u_W)), model.max_turn_rad});
  // the cone of the paper's Fig. 4: ∠(u, u0) ≤ max(α(d_t), ∠(u, u0) before)
  const double before_rad = angleBetween(state.u_W, state.u0_W);
  const double limit_rad =
      std::max(orientationLimitAngle(model.needle_length_m, tick.insertion_m), before_rad);
  const auto turnedBy = [&](double by_rad) {
    return normalized(state.u_W * detCos(by_rad) + side * detSin(by_rad));
  };
  if (angleBetween(turnedBy(angle), state.u0_W) > limit_rad) {
    double allowed = 0.0;
    for (double refused = angle; refused - allowed > kBisection_rad;) {
      const double middle = 0.5 * (allowed + refused);
      (angleBetween(turnedBy(middle), state.u0_W) <= limit_rad ? allowed : refused) = middle;
    }
    angle = allowed;
  }
  if (!(angle > kLeastTurn_rad)) return false;
  const Vec3 u = turnedBy(angle);
  assert(!(angleBetween(u, state.u0_W) > limit_rad));
  if (tick.insertion_m > model.lay_again_m) {
    moveLine(model, sample, state, state.p_entry_W_m, state.normal_W, u, tick);
    return true;
  }
  // near the skin the layers turn, too; the fixture's energy may only fall
  LayersAlong turned;
  const Vec3 lateral = tick.arm_W_m - u * dot(u, tick.arm_W_m);
  layLayers(model, state.p_entry_W_m, u, slantOf(state.normal_W, u), turned);
  const double k_N_per_m = lateralStiffness(state.along, tick.insertion_m).k_N_per_m;
  if (fixtureEnergy(model, lateralStiffness(turned, tick.insertion_m).k_N_per_m, norm(lateral)) >
      fixtureEnergy(model, k_N_per_m, tick.lateral_m))
    return false;
  moveLine(model, sample, state, state.p_entry_W_m, state.normal_W, u, tick);
  copyLayers(turned, state.along);
  return true;
}

}  // namespace needlelab
