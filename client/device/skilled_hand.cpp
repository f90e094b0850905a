#include "client/device/skilled_hand.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

constexpr HandSkill kBeginner{250e-6, 0.010, 4e-3, 5e-3, 6};
constexpr HandSkill kExpert{40e-6, 0.020, 0.7e-3, 0.5e-3, 1};
constexpr double kApproach_m = 0.02, kRest_s = 0.5;
constexpr double kOnSurface_m = 1e-6;

/// About a normal distribution: the sum of twelve uniform numbers less six; no C library decides about bits.
double nearlyNormal(HandRandom& random) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += random.uniform();
  return sum;
}

/// As an author wrote it: `signedDepth` wants a plane's normal of unit length.
double depthBelow(Limb limb, Vec3 p_W_m) {
  if (auto* plane = std::get_if<PlaneLimb>(&limb)) plane->normal = normalized(plane->normal);
  return signedDepth(limb, p_W_m);
}

}  // namespace

HandSkill skillOf(double level) {
  const double share = std::clamp(level, 0.0, 1.0);
  const auto between = [share](double beginner, double expert) {
    return beginner * std::pow(expert / beginner, share);
  };
  return {between(kBeginner.tremor_m, kExpert.tremor_m), between(kBeginner.speed_mps, kExpert.speed_mps),
          between(kBeginner.aim_m, kExpert.aim_m), between(kBeginner.overshoot_m, kExpert.overshoot_m),
          between(kBeginner.pieces, kExpert.pieces)};
}

HandOptions handOf(const HandSkill& skill, std::uint64_t seed) {
  HandOptions hand;
  hand.tremor_m = skill.tremor_m;
  hand.speed_mps = skill.speed_mps;
  hand.correction_per_s = 2;
  hand.aspirate = true;
  hand.seed = seed;
  return hand;
}

std::optional<Vec3> markedEntry(const Limb& limb_W, const Pose& X_WL) {
  if (!(std::abs(depthBelow(limb_W, X_WL.p)) <= kOnSurface_m)) return std::nullopt;
  return X_WL.p;
}

HandPlan attemptPlan(const HandSkill& skill, const Limb& limb_W, Vec3 target_W_m, HandRandom& random,
                     std::optional<Vec3> entry_W_m) {
  const Vec3 n = outwardNormal(limb_W, target_W_m);
  const Vec3 meant = entry_W_m ? *entry_W_m : target_W_m + n * depthBelow(limb_W, target_W_m);
  const Vec3 back = normalized(meant - target_W_m);
  const Vec3 side = normalized(cross(back, std::abs(back.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  const Vec3 other = cross(back, side);
  const auto astray = [&] {
    return (skill.aim_m * nearlyNormal(random)) * side + (skill.aim_m * nearlyNormal(random)) * other;
  };
  // the way that the hand takes: from where it enters to where it believes the target is
  const Vec3 entry = meant + astray();
  const Vec3 believed = target_W_m + 0.5 * astray();
  const Vec3 way = believed - entry;
  const double length_m = norm(way);
  const Vec3 axis = way / length_m;
  const Quat q = orientationAlong(axis);
  const auto at = [&](double along_m) { return Pose{entry + axis * along_m, q}; };
  const double beyond_m = skill.overshoot_m * (0.5 + random.uniform());

  // speed differs from attempt to attempt by a tenth
  const double speed_mps = skill.speed_mps * (0.9 + 0.2 * random.uniform());
  HandPlan plan(at(-kApproach_m));
  plan.plungerAtStart(kPlungerBeforeAspiration).hold(kRest_s);
  const int pieces = std::max(1, static_cast<int>(std::lround(skill.pieces + 0.5 * nearlyNormal(random))));
  const double whole_m = kApproach_m + length_m + beyond_m;
  for (int piece = 1; piece <= pieces; ++piece) {
    // pieces of uneven length, with a hesitation after each but the last
    const double share = piece == pieces ? 1 : (piece + 0.3 * (random.uniform() - 0.5)) / pieces;
    plan.moveTo(at(-kApproach_m + share * whole_m), speed_mps, Motion::kMinJerk);
    if (piece < pieces) plan.hold(0.15 + 0.35 * random.uniform());
  }
  plan.hold(0.2).moveTo(at(length_m), speed_mps, Motion::kMinJerk);
  plan.hold(0.8).hold(0.6, 0).hold(0.4).hold(1.2, 1).hold(0.3);
  plan.moveTo(at(-kApproach_m), speed_mps, Motion::kMinJerk).hold(kRest_s);
  return plan;
}

}  // namespace needlelab
