// By how much a needle missed, for a plane, a ball and a rod of skin.
#include "common/scoring/targets/miss.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "common/profile/profile.h"
#include "common/scoring/measures/syringe_events.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double kNear_m = 1e-6;
/// Where a line is nearest to a ball: it is hardly farther beside it.
constexpr double kNearest_m = 5e-5;

pb::Directions directions() {
  pb::Directions all;
  all.set_plus_x("down the arm");
  all.set_minus_x("up the arm");
  all.set_plus_y("towards the head");
  return all;
}

/// A half-space's layers with a ball of skin of this radius, its top at the origin.
pb::Profile ballOfSkin(double radius_m) {
  pb::Profile profile = halfSpace();
  auto& sphere = *profile.mutable_limb()->mutable_sphere();
  sphere.mutable_center_m()->set_z(-radius_m);
  sphere.set_radius_m(radius_m);
  return profile;
}

/// The same with a rod of skin along x, its top at the origin.
pb::Profile rodOfSkin(double radius_m) {
  pb::Profile profile = halfSpace();
  auto& rod = *profile.mutable_limb()->mutable_capsule();
  rod.mutable_a_m()->set_x(-0.1);
  rod.mutable_b_m()->set_x(0.1);
  rod.mutable_a_m()->set_z(-radius_m);
  rod.mutable_b_m()->set_z(-radius_m);
  rod.set_radius_m(radius_m);
  return profile;
}

/// Of a needle straight in along −z of L to the point, from 60 mm above it: whatever lies on its way.
Miss missOfPoint(const pb::Profile& profile, Vec3 p_L_m, const Pose& X_WL = {}, Vec3 axis_L = {0, 0, -1}) {
  const Vec3 axis_W = rotate(normalized(X_WL.q), axis_L);
  return missAt(anatomyOf(profile, X_WL), directions(), X_WL, {X_WL * p_L_m - 0.06 * axis_W, axis_W, 0.06});
}

TEST(Miss, saysTheDistanceAlongTheSkinAndTheDepth) {
  // the muscle is 10 to 20 mm deep: only the upper half of the ball at 20 mm counts
  pb::Profile profile = halfSpace();
  addTarget(profile, {0.01, 0.02, -0.02}, 0.003);
  profile.mutable_targets(0)->add_tissues("muscle");
  const auto textAt = [&](double x, double y, double deeper) {
    return missText(missOfPoint(profile, {0.01 + x, 0.02 + y, -0.02 - deeper}));
  };
  EXPECT_EQ(textAt(0, 0.0051, 0.0039), "Missed by 2.1 mm towards the head, 3.9 mm too deep.");
  EXPECT_EQ(textAt(-0.0051, 0, 0), "Missed by 2.1 mm up the arm.");
  EXPECT_EQ(textAt(0.001, 0.001, 0.0039), "Missed: 3.9 mm too deep.");
  EXPECT_EQ(textAt(0, 0, -0.0055), "Missed: 2.5 mm too shallow.") << "the target begins at 17 mm";
  EXPECT_EQ(textAt(0, 0.001, -0.002), "In the target.");
  EXPECT_EQ(textAt(0, 0, 0.00003), "Missed by less than 0.1 mm.");
}

TEST(Miss, namesTheNearestDirections) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.003);
  const auto towards = [&](double degrees) {
    const double angle = degrees * std::acos(-1.0) / 180;
    return missOfPoint(profile, {0.005 * std::cos(angle), 0.005 * std::sin(angle), -0.02}).towards;
  };
  EXPECT_THAT(towards(0), ElementsAre("down the arm"));
  EXPECT_THAT(towards(22), ElementsAre("down the arm"));
  EXPECT_THAT(towards(23), ElementsAre("down the arm", "towards the head"));
  EXPECT_THAT(towards(46), ElementsAre("towards the head", "down the arm"));
  EXPECT_THAT(towards(120), ElementsAre("towards the head", "up the arm"));
  EXPECT_THAT(towards(-40), ElementsAre("down the arm"));
  EXPECT_THAT(towards(-50), IsEmpty()) << "mostly towards −y, which has no name";
  EXPECT_EQ(missText(missOfPoint(profile, {0.001, -0.005, -0.02})), "Missed by 2.1 mm to the side.");
  EXPECT_EQ(missText(missOfPoint(profile, {0.003, 0.004, -0.02})),
            "Missed by 2.0 mm towards the head and down the arm.");
}

// of a line and a ball: where the line comes nearest to the centre, and how near
TEST(Miss, isAlongTheNeedleAndAcrossIt) {
  constexpr double kRadius = 0.002;
  const Vec3 centre{0.003, 0, -0.02};
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (pb::Profile profile : {halfSpace(), ballOfSkin(0.06), rodOfSkin(0.05)}) {
    addTarget(profile, centre, kRadius);
    int beside = 0, along = 0;
    for (int i = 0; i < 300; ++i) {
      const Vec3 axis = normalized(Vec3{uniform(random), uniform(random), -2});
      const Vec3 p = centre + Vec3{0.004 * uniform(random), 0.004 * uniform(random), 0.012 * uniform(random)};
      const Miss miss = missOfPoint(profile, p, {}, axis);
      const double beyond = dot(p - centre, axis);
      const Vec3 across = p - centre - beyond * axis;
      EXPECT_EQ(miss.in_target, norm(p - centre) <= kRadius);
      if (miss.in_target) continue;
      if (norm(across) < kRadius - 1e-6) {
        const double half = std::sqrt(kRadius * kRadius - normSquared(across));
        EXPECT_NEAR(miss.too_deep_m, beyond > 0 ? beyond - half : beyond + half, 1e-5);
        EXPECT_EQ(miss.aside_m, 0);
        ++along;
      } else if (norm(across) > kRadius + 1e-6) {
        EXPECT_NEAR(miss.too_deep_m, beyond, kNearest_m);
        EXPECT_NEAR(miss.aside_m, norm(across) - kRadius, kNear_m);
        ++beside;
      }
    }
    EXPECT_GT(beside, 50);
    EXPECT_GT(along, 30);
  }
}

TEST(Miss, isIndependentOfTheLimbsPlace) {
  const Pose X_WL{{0.3, -0.2, 0.1}, normalized(Quat{0.2, -0.5, 0.4, 0.7})};
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-0.015, 0.015);
  for (pb::Profile profile : {halfSpace(), ballOfSkin(0.06), rodOfSkin(0.05)}) {
    addTarget(profile, {0, 0, -0.02}, 0.003);
    profile.mutable_targets(0)->add_tissues("muscle");
    const Anatomy anatomy = anatomyOf(profile, {});
    for (int i = 0; i < 60; ++i) {
      const Vec3 p{uniform(random), uniform(random), uniform(random) - 0.02};
      const Miss here = missOfPoint(profile, p), there = missOfPoint(profile, p, X_WL);
      ASSERT_NEAR(here.aside_m, there.aside_m, 1e-6);
      ASSERT_NEAR(here.too_deep_m, there.too_deep_m, kNearest_m);
      ASSERT_EQ(here.towards, there.towards);
      // a miss has a length, and the way back is at least the distance
      const double distance_m = distanceTo(anatomy, anatomy.targets[0], p);
      ASSERT_EQ(here.in_target, distance_m <= 0);
      ASSERT_GE(here.aside_m + std::abs(here.too_deep_m), std::max(0.0, distance_m) - kNearest_m);
    }
  }
}

TEST(Miss, betweenTwoTissuesIsFromTheNearer) {
  // skin and bone count, the muscle between them does not
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.008);
  profile.mutable_targets(0)->add_tissues("skin");
  profile.mutable_targets(0)->add_tissues("bone");
  EXPECT_NEAR(missOfPoint(profile, {0, 0, -0.012}).too_deep_m, 0.002, kNear_m);
  EXPECT_NEAR(missOfPoint(profile, {0, 0, -0.019}).too_deep_m, -0.001, kNear_m);
}

// beyond the centre of a ball of skin a needle comes nearer to the skin again, but it is too deep
TEST(Miss, behindTheMiddleOfALimbIsTooDeep) {
  pb::Profile profile = ballOfSkin(0.025);
  addTarget(profile, {0, 0, -0.025}, 0.003);
  EXPECT_EQ(missText(missOfPoint(profile, {0, 0, -0.030})), "Missed: 2.0 mm too deep.");
}

TEST(Miss, farAsideIsADistanceToo) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.003);
  EXPECT_EQ(missText(missOfPoint(profile, {0.303, 0, -0.02})), "Missed by 300.0 mm down the arm.");
}

TEST(Miss, namesTheHazardsThatTheNeedleCameThrough) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.003);
  addBallHazard(profile, "vein", {0, 0, -0.01}, 0.001);
  addBallHazard(profile, "nerve", {0, 0, -0.03}, 0.001);
  const auto textAt = [&](double depth) { return missText(missOfPoint(profile, {0, 0, -depth})); };
  EXPECT_EQ(textAt(0.008), "Missed: 9.0 mm too shallow.");
  EXPECT_EQ(textAt(0.02), "Through the vein, in the target.");
  EXPECT_EQ(textAt(0.04), "Through the vein and the nerve, 17.0 mm too deep.");
  EXPECT_EQ(missText(missOfPoint(profile, {0.0005, -0.006, -0.02})), "Missed by 3.0 mm to the side.");
}

// skin and bone count, with a nerve between them
TEST(Miss, aTargetBehindAHazardIsNotOne) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.008);
  profile.mutable_targets(0)->add_tissues("skin");
  profile.mutable_targets(0)->add_tissues("bone");
  addBallHazard(profile, "nerve", {0, 0, -0.015}, 0.002);
  const auto textAt = [&](double depth, double x = 0) {
    return missText(missOfPoint(profile, {x, 0, -depth}));
  };
  EXPECT_EQ(textAt(0.0085), "In the target.");
  EXPECT_EQ(textAt(0.021), "Through the nerve, 11.0 mm too deep.");
  EXPECT_EQ(textAt(0.021, 0.0025), "In the target.") << "beside the nerve";
  EXPECT_EQ(textAt(0.030), "Through the nerve, 20.0 mm too deep.");
}

/// In to a depth, out, and in again 4 mm to the side to another depth; 1 s each.
std::vector<GestureSample> twice(double first_m, double second_m) {
  return gesture(1000, 4, [=](double t, GestureSample& s) {
    const double phase = t < 2 ? t : t - 2;
    const double way = phase < 1 ? phase : 2 - phase;
    setDepth(s, -0.01 + (t < 2 ? first_m + 0.01 : second_m + 0.01) * way);
    if (t >= 2) s.p_WT_m[1] = 0.004;
  });
}

TEST(Miss, ofAGestureIsAtTheFurthestPointOfItsLastInsertion) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.003);
  *profile.mutable_directions() = directions();
  const auto miss = missOf(twice(0.015, 0.0155), {}, profile, {});
  ASSERT_TRUE(miss.has_value());
  EXPECT_EQ(miss->at, Miss::At::kFurthest);
  EXPECT_FALSE(miss->in_target) << "the first insertion was";
  EXPECT_NEAR(miss->aside_m, 0.001, kNear_m);
  EXPECT_NEAR(miss->too_deep_m, 0.0005, kNearest_m);
  EXPECT_THAT(miss->towards, ElementsAre("towards the head"));
  EXPECT_EQ(missDirectionText(*miss), "At the furthest point of the last insertion, at the needle's tip.");
}

TEST(Miss, ofAGestureIsWhereItInjected) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.003);
  std::vector<GestureSample> samples = twice(0.025, 0.015);
  // the plunger goes in at 20 mm on the way in, and once more outside
  for (GestureSample& s : samples) {
    const double t = static_cast<double>(s.tick - samples.front().tick) / 1000;
    s.plunger = std::clamp((t - 0.857) / 0.05, 0.0, 0.5) + std::clamp((t - 1.95) / 0.05, 0.0, 0.4);
  }
  const auto events = syringeEvents(samples, 1000, profile, {});
  ASSERT_EQ(events.size(), 2u);
  ASSERT_TRUE(events[0].begin().in_tissue());
  ASSERT_FALSE(events[1].begin().in_tissue());
  const auto miss = missOf(samples, events, profile, {});
  ASSERT_TRUE(miss.has_value());
  EXPECT_EQ(miss->at, Miss::At::kInjection);
  EXPECT_NEAR(miss->too_deep_m, events[0].begin().depth_m() - 0.018, kNear_m);
  EXPECT_NEAR(events[0].begin().depth_m(), 0.020, 0.0005);
  EXPECT_EQ(missDirectionText(*miss), "Where the last injection began, at the needle's opening.");
}

TEST(Miss, isNothingWithoutATargetOrAnInsertion) {
  pb::Profile profile = halfSpace();
  EXPECT_FALSE(missOf(twice(0.01, 0.02), {}, profile, {}).has_value());
  addTarget(profile, {0, 0, -0.015}, 0.003);
  EXPECT_FALSE(missOf(twice(-0.001, -0.001), {}, profile, {}).has_value());
  EXPECT_FALSE(missOf({}, {}, profile, {}).has_value());
}

TEST(Miss, aSampleNamesItsDirections) {
  const auto profile = loadProfile(NEEDLELAB_SAMPLES "/lumbar-adult.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const auto textAt = [&](Vec3 p) {
    return missText(missAt(anatomyOf(*profile, {}), profile->directions(), {},
                           {p + Vec3{0, 0, 0.052}, {0, 0, -1}, 0.052}));
  };
  // the epidural space is 49 to 54 mm deep there, the target's ball of 2.5 mm around 52 mm
  EXPECT_EQ(textAt({-0.0046, 0, -0.052}), "Missed by 2.1 mm towards the head.");
  EXPECT_EQ(textAt({0.0046, 0, -0.052}), "Missed by 2.1 mm towards the feet.");
}

}  // namespace
}  // namespace needlelab
