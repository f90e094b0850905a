#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "client/device/hand/hand_plan.h"
#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

double angleBetween(Vec3 a, Vec3 b) {
  return std::atan2(norm(cross(a, b)), dot(a, b));
}

// greatest speed of the tip and greatest rotation rate, in steps of 1 ms
struct Pace {
  double speed_mps = 0, turn_radps = 0;
};
Pace paceOf(const HandPlan& plan) {
  Pace pace;
  const double dt = 1e-3;
  for (double t = 0; t < plan.duration_s(); t += dt) {
    const Pose a = plan.at(t).X_WT, b = plan.at(t + dt).X_WT;
    pace.speed_mps = std::max(pace.speed_mps, norm(b.p - a.p) / dt);
    const Quat d = b.q * conjugate(a.q);
    pace.turn_radps =
        std::max(pace.turn_radps, 2 * std::atan2(norm(Vec3{d.x, d.y, d.z}), std::abs(d.w)) / dt);
  }
  return pace;
}

TEST(ShareOfWay, followsItsFormula) {
  for (const Motion motion : {Motion::kLinear, Motion::kTrapezoid, Motion::kMinJerk}) {
    EXPECT_EQ(shareOfWay(motion, -1), 0);
    EXPECT_EQ(shareOfWay(motion, 0), 0);
    EXPECT_NEAR(shareOfWay(motion, 0.5), 0.5, 1e-15);
    EXPECT_NEAR(shareOfWay(motion, 1), 1, 1e-15);
    EXPECT_NEAR(shareOfWay(motion, 2), 1, 1e-15);
    for (int i = 0; i < 100; ++i) {
      const double t = i / 100.0;
      EXPECT_LT(shareOfWay(motion, t), shareOfWay(motion, t + 0.01));
      EXPECT_NEAR(shareOfWay(motion, t) + shareOfWay(motion, 1 - t), 1, 1e-14);  // symmetric in time
    }
  }
  EXPECT_DOUBLE_EQ(shareOfWay(Motion::kMinJerk, 0.25), 10 / 64.0 - 15 / 256.0 + 6 / 1024.0);
  // the area under a trapezoid of height 1/0.85 up to the end of its ramp
  EXPECT_DOUBLE_EQ(shareOfWay(Motion::kTrapezoid, 0.15), 0.15 / 2 / 0.85);
}

TEST(HandPlan, movesReachTheRequestedSpeedOnly) {
  for (const Motion motion : {Motion::kLinear, Motion::kTrapezoid, Motion::kMinJerk}) {
    const Pose from{{0.1, -0.2, 0.3}, {}};
    const Pose to{{0.1, -0.2, 0.24}, {}};
    const HandPlan plan = HandPlan(from).moveTo(to, 0.03, motion);
    EXPECT_NEAR(paceOf(plan).speed_mps, 0.03, 0.03 * 1e-4);
    EXPECT_EQ(plan.at(-1).X_WT, from);
    EXPECT_NEAR(norm(plan.at(plan.duration_s() + 1).X_WT.p - to.p), 0, 1e-16);
  }
}

TEST(HandPlan, turningOnTheSpotTakesTimeToo) {
  const Quat quarter = orientationAlong({1, 0, 0});
  const HandPlan plan = HandPlan(Pose{}).moveTo({{}, quarter}, 0.02, Motion::kMinJerk);
  EXPECT_GT(plan.duration_s(), 1.5);
  const Pace pace = paceOf(plan);
  EXPECT_EQ(pace.speed_mps, 0);
  EXPECT_LE(pace.turn_radps, 1.3);
}

TEST(HandPlan, holdingMovesOnlyThePlunger) {
  const Pose here{{1, 2, 3}, {}};
  HandPlan plan(here);
  plan.hold(1).hold(2, 1.0).hold(1);
  EXPECT_DOUBLE_EQ(plan.duration_s(), 4);
  EXPECT_EQ(plan.at(0.5).plunger, 0);
  EXPECT_DOUBLE_EQ(plan.at(2).plunger, 0.5);
  EXPECT_EQ(plan.at(3.5).plunger, 1);
  for (double t = 0; t < 5; t += 0.1) EXPECT_EQ(plan.at(t).X_WT, here);
}

TEST(HandPlan, anEmptyPlanStaysAtItsStart) {
  const HandPlan plan({{0, 0, 0.1}, {}});
  EXPECT_EQ(plan.duration_s(), 0);
  EXPECT_EQ(plan.at(0).X_WT.p.z, 0.1);
  EXPECT_EQ(plan.at(100).X_WT.p.z, 0.1);
}

TEST(OrientationAlong, putsTheNeedleAlongTheAxisInEveryDirection) {
  for (int i = 0; i < 500; ++i) {
    // a spiral over the whole sphere, both poles included
    const double z = -1 + 2 * i / 499.0, r = std::sqrt(std::max(0.0, 1 - z * z)), a = 2.4 * i;
    const Vec3 axis = normalized(Vec3{r * std::cos(a), r * std::sin(a), z});
    const Quat q = orientationAlong(axis * (0.001 + i));
    EXPECT_NEAR(dot(q, q), 1, 1e-15);
    EXPECT_LT(angleBetween(zAxis(q), axis), 1e-12);
    EXPECT_LT(norm(rotate(q, {0, 0, 1}) - axis), 1e-12);
  }
  // no sudden roll near straight down, where needles point
  EXPECT_GT(std::abs(dot(orientationAlong({1e-6, 0, -1}), orientationAlong({0, 1e-6, -1}))), 1 - 1e-9);
}

const Limb kOblique = PlaneLimb{{0.01, 0.02, 0.03}, normalized(Vec3{1, -2, 3})};
const Limb kLongNormal = PlaneLimb{{0.01, 0.02, 0.03}, {1, -2, 3}};  // the same limb
const Limb kBall = SphereLimb{{0.1, 0, -0.05}, 0.04};
const Limb kArm = CapsuleLimb{{-0.1, 0, 0}, {0.1, 0.02, 0}, 0.045};

TEST(OutwardNormal, isTheGradientOfDepthDownwards) {
  const Vec3 points[] = {{0.11, 0.01, -0.04}, {0.02, 0.03, -0.01}, {0.3, -0.1, 0.02}, {-0.25, 0, -0.1}};
  for (const Limb& limb : {kOblique, kBall, kArm})
    for (const Vec3 p : points) {
      const Vec3 n = outwardNormal(limb, p);
      EXPECT_NEAR(norm(n), 1, 1e-15);
      const double h = 1e-5;
      EXPECT_NEAR((signedDepth(limb, p + n * h) - signedDepth(limb, p - n * h)) / (2 * h), -1, 1e-8);
    }
}

TEST(OutwardNormal, isDefinedWhereTheNearestPointIsNotUnique) {
  EXPECT_EQ(outwardNormal(kBall, {0.1, 0, -0.05}), (Vec3{0, 0, 1}));
  EXPECT_NEAR(outwardNormal(kArm, {0, 0.01, 0}).z, 1, 1e-12);
  const Limb upright = CapsuleLimb{{0, 0, 0}, {0, 0, 0.1}, 0.02};
  EXPECT_NEAR(norm(outwardNormal(upright, {0, 0, 0.05})), 1, 1e-15);
}

TEST(TargetPlan, reachesTheTargetStraightThroughTheSkinAndComesBack) {
  PlanStyle style;
  for (const Limb& limb : {kOblique, kBall, kArm}) {
    const bool plane = std::holds_alternative<PlaneLimb>(limb);
    const Vec3 target = plane ? Vec3{0.01, 0.02, 0.01} : Vec3{0.09, 0.01, -0.03};
    ASSERT_GT(signedDepth(limb, target), 0.001);
    const HandPlan plan = targetPlan(plane ? kLongNormal : limb, target, style);
    EXPECT_NEAR(signedDepth(limb, plan.start().X_WT.p), -style.approach_m, 1e-9);
    EXPECT_EQ(plan.end().X_WT.p, plan.start().X_WT.p);
    double nearest = 1, plunger = 0;
    for (double t = 0; t < plan.duration_s(); t += 0.01) {
      nearest = std::min(nearest, norm(plan.at(t).X_WT.p - target));
      plunger = std::max(plunger, plan.at(t).plunger);
    }
    EXPECT_LT(nearest, 1e-12);
    EXPECT_GT(plunger, 0.99);
    EXPECT_LT(angleBetween(zAxis(plan.start().X_WT.q), -outwardNormal(limb, target)), 1e-9);
    EXPECT_LE(paceOf(plan).speed_mps, style.insertion_speed_mps * 1.001);
  }
}

TEST(TargetPlan, drawsThePlungerBackBeforeItInjectsWhereAskedTo) {
  PlanStyle style;
  style.aspirate = true;
  style.hold_s = 4;
  const Limb level = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  const Vec3 target{0, 0, -0.02};
  const HandPlan plan = targetPlan(level, target, style);
  PlanStyle plain = style;
  plain.aspirate = false;
  const HandPlan before = targetPlan(level, target, plain);
  EXPECT_EQ(plan.duration_s(), before.duration_s());
  EXPECT_EQ(before.start().plunger, 0);
  // The tip moves as before; the plunger rests, is pulled back in the second quarter of the hold, then
  // pressed.
  double hold_begins_s = -1;
  for (double t = 0; t < plan.duration_s(); t += 0.01) {
    EXPECT_EQ(plan.at(t).X_WT.p, before.at(t).X_WT.p) << t;
    if (hold_begins_s < 0 && norm(plan.at(t).X_WT.p - target) < 1e-12) hold_begins_s = t;
  }
  const auto at = [&](double since_s) { return plan.at(hold_begins_s + since_s).plunger; };
  EXPECT_EQ(plan.start().plunger, kPlungerBeforeAspiration);
  EXPECT_NEAR(at(0.95), kPlungerBeforeAspiration, 1e-12);
  EXPECT_NEAR(at(1.5), kPlungerBeforeAspiration / 2, 0.002);
  EXPECT_NEAR(at(2), 0, 0.006);
  EXPECT_NEAR(at(3), 0.5, 0.006);
  EXPECT_NEAR(at(4), 1, 1e-12);
}

TEST(RetryPlan, missesFirstAndNeverJumps) {
  PlanStyle style;
  const Limb level = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  const Vec3 target{0, 0, -0.03};
  const HandPlan plan = retryPlan(level, target, 0.3, style);
  // The first deepest point misses the path to the target by the sine of the miss angle; the last one is the
  // target.
  double first_aside = 0, nearest = 1;
  for (double t = 0; t < plan.duration_s(); t += 0.001) {
    const Vec3 p = plan.at(t).X_WT.p;
    if (t < plan.duration_s() / 3) first_aside = std::max(first_aside, std::hypot(p.x, p.y));
    nearest = std::min(nearest, norm(p - target));
  }
  EXPECT_NEAR(first_aside, 0.9 * 0.03 * std::sin(0.3), 2e-4);
  EXPECT_LT(nearest, 1e-5);
  const Pace pace = paceOf(plan);
  EXPECT_LE(pace.speed_mps, 5 * style.insertion_speed_mps * 1.001);
  EXPECT_LE(pace.turn_radps, 1.5);
}

}  // namespace
}  // namespace needlelab
