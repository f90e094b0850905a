// Orientation limit (FORCE_MODEL.md, "Orientation limit", paper eq. 7) by formula.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/haptics/scene_model.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

SceneSpec tiltScene(double stiffness = 0.5, double most = 5) {
  SceneSpec scene = withEffects(paperOneDof(), bitOf(Effect::kOrientationLimit));
  scene.orientation_limit = {stiffness, most};
  return scene;
}

double cone(double length, double inserted) {
  return std::atan((length - inserted) / (length + inserted));
}

TEST(OrientationLimit, alphaIsEquationSeven) {
  for (const double length : {0.01, 0.06, 1.0}) {
    EXPECT_NEAR(orientationLimitAngle(length, 0), std::numbers::pi / 4, 1e-15);
    EXPECT_EQ(orientationLimitAngle(length, length), 0.0);
    EXPECT_EQ(orientationLimitAngle(length, 2 * length), 0.0) << "d_t is held to [0, L]";
    EXPECT_NEAR(orientationLimitAngle(length, -1), std::numbers::pi / 4, 1e-15);
    for (int i = 0; i <= 100; ++i)
      EXPECT_NEAR(orientationLimitAngle(length, length * i / 100), cone(length, length * i / 100), 2e-16);
  }
}

TEST(OrientationLimit, tiltingADeepNeedleGivesASpringBackToTheCone) {
  Probe probe(tiltScene(), 1000);
  probe.at(-0.001);
  probe.go(300, 0.03);
  const double alpha = cone(0.06, 0.03);
  for (double degrees = 1; degrees <= 60; degrees += 1) {
    probe.tilt(degrees * kDegree);
    const StepReport report = probe.at(0.03);
    const double expected = std::max(0.0, 0.5 * (degrees * kDegree - alpha));
    ASSERT_NEAR(norm(report.wrench_W.torque_Nm), expected, 1e-12) << degrees;
    ASSERT_EQ((report.flags & kFlagTorque) != 0, expected > 0) << degrees;
    if (expected > 0) {
      // it turns the axis back toward u: about axis × u
      const Vec3 about = normalized(cross(probe.site().across_1, probe.site().inward));
      ASSERT_NEAR(dot(report.wrench_W.torque_Nm, about), expected, 1e-12);
    }
  }
  EXPECT_EQ(norm(probe.last().wrench_W.force_N), 0.0) << "torque alone";
}

TEST(OrientationLimit, torqueIsCapped) {
  Probe probe(tiltScene(2.0, 0.2), 1000);
  probe.at(-0.001);
  probe.go(300, 0.05);
  probe.tilt(60 * kDegree);
  EXPECT_NEAR(norm(probe.at(0.05).wrench_W.torque_Nm), 0.2, 1e-12);
}

TEST(OrientationLimit, goingDeeperNeverPushesATiltedNeedleBack) {
  Probe probe(tiltScene(), 1000);
  probe.at(-0.001);
  probe.go(50, 0.002);
  for (int degrees = 1; degrees <= 40; ++degrees) {
    probe.tilt(degrees * kDegree);
    ASSERT_EQ(norm(probe.at(0.002).wrench_W.torque_Nm), 0) << "40° is within the cone at the skin";
  }
  for (const auto& report : probe.go(500, 0.058)) ASSERT_EQ(norm(report.wrench_W.torque_Nm), 0.0);
  // The freedom is used up: any further tilt is resisted from here on.
  probe.tilt(42 * kDegree);
  EXPECT_NEAR(norm(probe.at(0.058).wrench_W.torque_Nm), 0.5 * 2 * kDegree, 1e-9);
  // The reduced limit stays: after 20° it is 20°.
  probe.tilt(20 * kDegree);
  probe.at(0.058);
  probe.tilt(30 * kDegree);
  EXPECT_NEAR(norm(probe.at(0.058).wrench_W.torque_Nm), 0.5 * 10 * kDegree, 1e-9);
}

TEST(OrientationLimit, theTiltPumpGivesNoEnergy) {
  // `tilt_pump`: tilt 44° at the skin, in, straight, out
  const Site site = defaultSite();
  const auto at = [&](double depth) { return site.p_surface_m + site.inward * depth; };
  const Vec3 aside = tilted(site.inward, std::tan(44 * kDegree), site.across_1);
  MotionBuilder builder(4000, at(-0.002), site.inward);
  builder.moveTo(at(0.0005), 0.2).moveTo(at(0.0005), aside, 0.4).moveTo(at(0.055), 0.8);
  builder.moveTo(at(0.055), site.inward, 0.4).moveTo(at(-0.002), 0.8);
  const Motion motion = builder.take();
  EngineRun run(tiltScene(1.0, 5), 4000);
  EXPECT_LE(energyToHand(motion, run.run(motion)), 5e-5);
}

TEST(OrientationLimit, tiltedEntryBeyondTheConeStartsWithoutTorque) {
  // the axis points out, 120° off the inward direction: u is mirrored at the skin, θ_l = θ = 60°
  Probe probe(tiltScene(), 1000);
  probe.tilt(120 * kDegree);
  probe.at(-0.001);
  for (const auto& report : probe.go(300, 0.02)) ASSERT_EQ(norm(report.wrench_W.torque_Nm), 0.0);
  const Vec3 mirrored = tilted(probe.site().inward, std::tan(60 * kDegree), probe.site().across_1);
  EXPECT_NEAR(norm(probe.state().u_W - mirrored), 0, 1e-12);
  probe.tilt(121 * kDegree);
  EXPECT_NEAR(norm(probe.at(0.02).wrench_W.torque_Nm), 0.5 * kDegree, 1e-9);
}

TEST(OrientationLimit, aFlippedNeedleHasNoTorqueDirection) {
  Probe probe(tiltScene(), 1000);
  probe.point(-probe.site().inward);
  probe.at(-0.001);
  for (const auto& report : probe.go(300, 0.02)) {
    ASSERT_EQ(report.wrench_W.torque_Nm, (Vec3{}));
    ASSERT_TRUE(isFinite(report.wrench_W.force_N));
  }
}

TEST(OrientationLimit, beyondTheNeedlesLengthItIsFiniteAndFlagged) {
  Probe probe(tiltScene(), 1000);
  probe.at(-0.001);
  probe.go(700, 0.07);
  probe.tilt(3 * kDegree);
  const StepReport report = probe.at(0.07);
  EXPECT_TRUE(report.flags & kFlagBeyondNeedle);
  EXPECT_NEAR(report.insertion_m, 0.07, 1e-12);
  EXPECT_NEAR(norm(report.wrench_W.torque_Nm), 0.5 * 3 * kDegree, 1e-9) << "α = 0: no freedom is left";
  EXPECT_FALSE(probe.at(0.05).flags & kFlagBeyondNeedle);
}

// u may be α from the direction of entry, and the axis, too: before, the axis was α from u, so 2α in all
TEST(OrientationLimit, isMeasuredFromTheDirectionOfEntry) {
  SceneSpec scene = withClamping(oneLayer(1, 0.5, 0.1), ClampingMode::kConservative);
  scene.layers[0].lateral_stiffness_N_per_m2 = 9000;
  scene.effects = bitOf(Effect::kClamping) | bitOf(Effect::kOrientationLimit);
  scene.orientation_limit = {0.5, 0.2};
  const double length_m = scene.needle_length_m;
  for (const double re_aimed : {0.0, 15 * kDegree}) {
    Probe probe(scene, 1000);
    probe.at(-1e-4);
    probe.go(500, 0.01);
    for (int i = 1; i <= 500; ++i) {
      const double angle = re_aimed * i / 500;
      probe.tilt(angle);
      probe.at(0.01 * std::cos(angle), 0.01 * std::sin(angle));
    }
    probe.go(1000, 0.025 * std::cos(re_aimed), 0.025 * std::sin(re_aimed));
    EXPECT_NEAR(std::acos(dot(probe.state().u_W, probe.site().inward)), 0.9 * re_aimed, 0.1 * re_aimed);
    const double alpha = std::atan((length_m - 0.025) / (length_m + 0.025));
    double begins = 0;
    Vec3 torque_before;
    for (double tilt = re_aimed; tilt < 1; tilt += 1e-3) {
      probe.tilt(tilt);
      const StepReport report = probe.stay(1).front();
      if (begins == 0 && norm(report.wrench_W.torque_Nm) > 0) begins = tilt;
      ASSERT_LE(norm(report.wrench_W.torque_Nm - torque_before), 0.5 * 1e-3 + 2e-3) << tilt;
      torque_before = report.wrench_W.torque_Nm;
    }
    EXPECT_NEAR(begins, alpha, 2e-3) << re_aimed;
  }
}

// drawn back to the skin with a torque, u0 comes after u: the torque goes without a step
TEST(OrientationLimit, theTorqueHasNoStepWhereTheDirectionOfEntryFollows) {
  SceneSpec scene = withClamping(oneLayer(1, 0.5, 0.1), ClampingMode::kConservative);
  scene.layers[0].lateral_stiffness_N_per_m2 = 9000;
  scene.effects = bitOf(Effect::kClamping) | bitOf(Effect::kOrientationLimit);
  scene.orientation_limit = {0.5, 0.2};
  Probe probe(scene, 1000);
  probe.at(-1e-4);
  probe.go(500, 0.02);
  Vec3 before;
  const auto tick = [&](double tilt, double depth_m) {
    probe.tilt(tilt);
    const Vec3 torque = probe.at(depth_m, depth_m * std::tan(0.3)).wrench_W.torque_Nm;
    ASSERT_LE(norm(torque - before), 0.5 * 2e-3 + 2e-3) << depth_m;
    before = torque;
  };
  for (int i = 0; i <= 450; ++i) tick(0.002 * i, 0.02);
  EXPECT_GT(norm(before), 0.1);
  for (int i = 0; i < 2000; ++i) tick(0.9, 0.02 - 0.0000099 * i);
  for (int i = 0; i < 1000; ++i) tick(0.9, 0.0002);
}

}  // namespace
}  // namespace needlelab::test
