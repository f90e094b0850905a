#include "client/device/hand/hand_plan.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <optional>
#include <utility>
#include <variant>

#include "common/haptics/scene_model.h"
#include "common/haptics/soft_tissue.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

constexpr double kRamp = 0.15;          // share of a trapezoid's time for speeding up, and for slowing down
constexpr double kMinJerkPeak = 1.875;  // greatest over mean speed of a minimum-jerk move
constexpr double kTurnSpeed_radps = 1;  // of a turn on the spot
constexpr double kShortestMove_s = 1e-3;

// returns the shortest rotation from unit vector `from` to unit vector `to`, which must not be opposite
Quat shortestTurn(Vec3 from, Vec3 to) {
  const Vec3 axis = cross(from, to);
  return normalized(Quat{axis.x, axis.y, axis.z, 1 + dot(from, to)});
}

// `q` turned so that its z axis is the unit vector `axis`, without roll
Quat turnedTo(Quat q, Vec3 axis) {
  return shortestTurn(zAxis(q), axis) * q;
}

Quat between(Quat a, Quat b, double share) {
  const double sign = dot(a, b) < 0 ? -1 : 1;
  const double u = 1 - share, v = sign * share;
  return normalized(Quat{u * a.x + v * b.x, u * a.y + v * b.y, u * a.z + v * b.z, u * a.w + v * b.w});
}

// length of the turn between two rotations: 2 sin(angle/2), close to the angle for a hand's turns
double turnBetween(Quat a, Quat b) {
  const Quat d = b * conjugate(a);
  return 2 * std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
}

Vec3 nearestOnSegment(Vec3 a, Vec3 b, Vec3 p) {
  const Vec3 d = b - a;
  const double length2 = normSquared(d);
  if (length2 <= 0) return a;
  return a + d * std::clamp(dot(p - a, d) / length2, 0.0, 1.0);
}

Vec3 directionOr(Vec3 v, Vec3 fallback) {
  return normSquared(v) > 0 ? normalized(v) : fallback;
}

constexpr Vec3 kUp{0, 0, 1};

// δ of an author's limb; normalises a plane's normal, because `signedDepth` requires a unit one
double depthOf(Limb limb, Vec3 p) {
  if (auto* plane = std::get_if<PlaneLimb>(&limb)) plane->normal = normalized(plane->normal);
  return signedDepth(limb, p);
}

// adds a hold: draws the plunger back in the second quarter if requested, and presses it in the second half
void holdAndInject(HandPlan& plan, const PlanStyle& style) {
  if (style.aspirate)
    plan.hold(style.hold_s / 4).hold(style.hold_s / 4, 0);
  else
    plan.hold(style.hold_s / 2);
  plan.hold(style.hold_s / 2, 1);
}

}  // namespace

double shareOfWay(Motion motion, double t) noexcept {
  t = std::clamp(t, 0.0, 1.0);
  switch (motion) {
    case Motion::kLinear:
      return t;
    case Motion::kTrapezoid: {
      const double cruise =
          1 / (1 - kRamp);  // speed in the middle, as a share of the way per share of the time
      if (t < kRamp) return cruise * t * t / (2 * kRamp);
      if (t > 1 - kRamp) return 1 - cruise * (1 - t) * (1 - t) / (2 * kRamp);
      return cruise * (t - kRamp / 2);
    }
    case Motion::kMinJerk:
      return t * t * t * (10 + t * (6 * t - 15));
  }
  return t;
}

HandPlan::HandPlan(const Pose& start) : start_{start} {}

HandPlan& HandPlan::plungerAtStart(double plunger) {
  assert(segments_.empty());
  start_.plunger = plunger;
  return *this;
}

void HandPlan::add(const HandAim& to, double seconds, Motion motion) {
  assert(seconds > 0);
  segments_.push_back({end_s_, seconds, end(), to, motion});
  end_s_ += seconds;
}

HandPlan& HandPlan::hold(double seconds, double plunger) {
  add({end().X_WT, plunger, false}, seconds, Motion::kLinear);
  return *this;
}

HandPlan& HandPlan::setPlunger(double plunger) {
  start_.plunger = plunger;
  for (Segment& segment : segments_) segment.from.plunger = segment.to.plunger = plunger;
  return *this;
}

HandPlan& HandPlan::pressCapButton(double seconds) {
  HandAim pressed = end();
  pressed.presses_cap_button = true;
  add(pressed, seconds, Motion::kLinear);
  pressed.presses_cap_button = false;
  add(pressed, seconds, Motion::kLinear);
  return *this;
}

HandPlan& HandPlan::then(const HandPlan& next, double speed_mps) {
  moveTo(next.start().X_WT, speed_mps, Motion::kMinJerk);
  for (const Segment& segment : next.segments_) add(segment.to, segment.duration_s, segment.motion);
  return *this;
}

HandPlan& HandPlan::moveIn(const Pose& to, double seconds, double plunger, Motion motion) {
  add({to, plunger, false}, seconds, motion);
  return *this;
}

HandPlan& HandPlan::moveTo(const Pose& to, double speed_mps, Motion motion) {
  const Pose from = end().X_WT;
  const double peak = motion == Motion::kLinear      ? 1
                      : motion == Motion::kTrapezoid ? 1 / (1 - kRamp)
                                                     : kMinJerkPeak;
  const double seconds =
      peak * std::max(norm(to.p - from.p) / speed_mps, turnBetween(from.q, to.q) / kTurnSpeed_radps);
  return moveIn(to, std::max(seconds, kShortestMove_s), motion);
}

HandAim HandPlan::at(double t_s) const noexcept {
  // the last segment that starts at or before t
  const auto after = std::upper_bound(segments_.begin(), segments_.end(), t_s,
                                      [](double t, const Segment& segment) { return t < segment.start_s; });
  if (after == segments_.begin()) return start_;
  const Segment& now = *(after - 1);
  const double share = shareOfWay(now.motion, (t_s - now.start_s) / now.duration_s);
  HandAim aim;
  aim.X_WT.p = now.from.X_WT.p + (now.to.X_WT.p - now.from.X_WT.p) * share;
  aim.X_WT.q = between(now.from.X_WT.q, now.to.X_WT.q, share);
  aim.plunger = now.from.plunger + (now.to.plunger - now.from.plunger) * share;
  aim.presses_cap_button = now.to.presses_cap_button;
  return aim;
}

Quat orientationAlong(Vec3 axis) {
  const Vec3 a = normalized(axis);
  // start from the nearer of +z and −z, so that the vectors are never opposite; half a turn about x gives −z
  return a.z >= 0 ? shortestTurn(kUp, a) : turnedTo(Quat{1, 0, 0, 0}, a);
}

Vec3 outwardNormal(const Limb& limb, Vec3 p_W_m) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return normalized(plane->normal);
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) return directionOr(p_W_m - sphere->center_m, kUp);
  if (std::holds_alternative<BodyLimb>(limb)) return surfaceNormal(limb, p_W_m, -kUp);
  const auto& capsule = std::get<CapsuleLimb>(limb);
  const Vec3 out = p_W_m - nearestOnSegment(capsule.a_m, capsule.b_m, p_W_m);
  if (normSquared(out) > 0) return normalized(out);
  // on the axis: the direction across it that is nearest to up
  const Vec3 along = directionOr(capsule.b_m - capsule.a_m, Vec3{1, 0, 0});
  const Vec3 across = kUp - along * dot(along, kUp);
  return directionOr(across, Vec3{1, 0, 0});
}

Vec3 skinAbove(const Limb& limb, Vec3 p_W_m, Vec3 n) {
  if (std::holds_alternative<BodyLimb>(limb)) return nearestSkin(limb, p_W_m, -n);
  return p_W_m + n * depthOf(limb, p_W_m);
}

HandPlan insertionPlan(Vec3 entry_W_m, Vec3 axis_W, double depth_m, const PlanStyle& style) {
  const Vec3 axis = normalized(axis_W);
  const Quat q = orientationAlong(axis);
  const Pose start{entry_W_m - axis * style.approach_m, q};
  const Pose deepest{entry_W_m + axis * depth_m, q};
  HandPlan plan(start);
  if (style.aspirate) plan.plungerAtStart(kPlungerBeforeAspiration);
  plan.hold(style.rest_s).moveTo(deepest, style.insertion_speed_mps, Motion::kTrapezoid);
  holdAndInject(plan, style);
  plan.moveTo(start, style.insertion_speed_mps, Motion::kTrapezoid).hold(style.rest_s);
  return plan;
}

HandPlan targetPlan(const Limb& limb_W, Vec3 target_W_m, const PlanStyle& style,
                    std::optional<Vec3> entry_W_m) {
  const Vec3 n = outwardNormal(limb_W, target_W_m);
  if (std::holds_alternative<BodyLimb>(limb_W)) {
    const Vec3 entry = entry_W_m ? *entry_W_m : skinAbove(limb_W, target_W_m, n);
    return insertionPlan(entry, directionOr(target_W_m - entry, -n), norm(target_W_m - entry), style);
  }
  const double depth = depthOf(limb_W, target_W_m);
  return insertionPlan(target_W_m + n * depth, -n, depth, style);
}

namespace {

// How deep the tip is where the ball, straight in from a place on the skin, pushes back with a force; at most
// 30 mm.
double depthOfPress(const SceneSpec& scene_W, Vec3 at_W_m, Vec3 out_W, double press_N) {
  constexpr double kDeepest_m = 0.03, kStep_m = 1e-4;
  const StageNumbers& numbers = scene_W.stage_numbers[stageOf(Effect::kPalpation)];
  const double radius_m = numbers[kPalpationRadius_m], bone_N_per_m = numbers[kPalpationBone_N_per_m],
               share = numbers[kPalpationStiffening];
  const SoftTissue tissue{numbers[kPalpationSkin_N_per_m], share * bone_N_per_m};
  double cover_m = std::numeric_limits<double>::infinity();
  if (const auto* const limb = std::get_if<BodyLimb>(&scene_W.limb)) {
    const Vec3 ball_L_m = inverse(limb->X_WL) * (at_W_m + out_W * radius_m);
    cover_m = std::max(0.0, limb->body->around(ball_L_m, radius_m)->bone(ball_L_m).distance_m - radius_m);
  }
  double pressed_m = 0;
  while (pressed_m < kDeepest_m + radius_m &&
         tissue.at(pressed_m, cover_m).force_N +
                 (1 - share) * bone_N_per_m * std::max(0.0, pressed_m - cover_m) <
             press_N)
    pressed_m += kStep_m;
  return pressed_m - radius_m;
}

}  // namespace

HandPlan palpationPlan(const SceneSpec& scene_W, Vec3 landmark_W_m, double speed_mps) {
  constexpr double kHover_m = 0.012, kAside_m = 0.015, kPress_N = 2.4, kLeast_m = 5e-4;
  constexpr double kPause_s = 0.5, kCapButton_s = 0.1;
  const Limb& limb_W = scene_W.limb;
  const double radius_m = scene_W.stage_numbers[stageOf(Effect::kPalpation)][kPalpationRadius_m];
  const Vec3 over = skinAbove(limb_W, landmark_W_m, outwardNormal(limb_W, landmark_W_m));
  const Vec3 n = outwardNormal(limb_W, over);
  const Vec3 aside = normalized(cross(n, std::abs(n.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  std::optional<HandPlan> plan;
  for (const double aside_m : {kAside_m, -kAside_m, 0.0}) {
    const Vec3 at = skinAbove(limb_W, over + aside * aside_m, n), out = outwardNormal(limb_W, at);
    double depth_m = depthOfPress(scene_W, at, out, kPress_N);
    if (aside_m == 0.0) depth_m = std::max(depth_m, norm(landmark_W_m - over) + kLeast_m - radius_m);
    const Quat q = orientationAlong(-out);
    const Pose hover{at + out * kHover_m, q}, pressed{at - out * depth_m, q};
    if (plan)
      plan->moveTo(hover, speed_mps, Motion::kMinJerk);
    else
      plan.emplace(hover).hold(kPause_s);
    plan->moveTo(pressed, speed_mps, Motion::kMinJerk);
    plan->hold(kPause_s).moveTo(hover, speed_mps, Motion::kMinJerk);
  }
  return plan->pressCapButton(kCapButton_s);
}

HandPlan retryPlan(const Limb& limb_W, Vec3 target_W_m, double miss_rad, const PlanStyle& style,
                   std::optional<Vec3> entry_W_m) {
  const Vec3 n = outwardNormal(limb_W, target_W_m);
  const bool in_body = std::holds_alternative<BodyLimb>(limb_W);
  const Vec3 entry = in_body && entry_W_m ? *entry_W_m : skinAbove(limb_W, target_W_m, n);
  const double depth = in_body ? norm(target_W_m - entry) : depthOf(limb_W, target_W_m);
  const Vec3 right = in_body ? directionOr(target_W_m - entry, -n) : -n;
  // any direction across; the miss is small, so the tangent's first terms suffice
  const Vec3 across = normalized(cross(n, std::abs(n.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  const Vec3 wrong = normalized(right + across * (miss_rad * (1 + miss_rad * miss_rad / 3)));
  const Quat q_right = orientationAlong(right), q_wrong = turnedTo(q_right, wrong);
  const double speed = style.insertion_speed_mps;
  const Pose start{entry - wrong * style.approach_m, q_wrong};
  const Pose missed{entry + wrong * (0.9 * depth), q_wrong};
  const Pose drawn_back{entry + wrong * (0.3 * depth), q_wrong};
  const Pose turned{entry + right * (0.3 * depth), q_right};
  const Pose out{entry - right * style.approach_m, q_right};
  HandPlan plan(start);
  if (style.aspirate) plan.plungerAtStart(kPlungerBeforeAspiration);
  plan.hold(style.rest_s)
      .moveTo(missed, speed, Motion::kTrapezoid)
      .hold(style.hold_s / 2)
      .moveTo(drawn_back, speed, Motion::kTrapezoid)
      .moveTo(turned, speed, Motion::kMinJerk)
      .moveTo({target_W_m, q_right}, speed, Motion::kTrapezoid);
  holdAndInject(plan, style);
  plan.moveTo(out, speed, Motion::kTrapezoid).hold(style.rest_s).moveTo(start, 5 * speed, Motion::kMinJerk);
  return plan;
}

}  // namespace needlelab
