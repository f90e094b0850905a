#include "common/haptics/gate/handle_stiffness.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/haptics/engine.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

constexpr double kAxial_N_per_m = 700;

SceneSpec sceneOf(double fixture_N_per_m, double orientation_Nm_per_rad) {
  SceneSpec scene = paperSixLayers();
  scene.virtual_fixture.max_stiffness_N_per_m = fixture_N_per_m;
  scene.orientation_limit = {orientation_Nm_per_rad, 0.2};
  return scene;
}

Pose straight(double lever_m) {
  return {{0, 0, lever_m}, {}};
}

// twice the springs' energy at a turn of one radian about the worst of many axes, without the orientation
// limit
double worstTurn_Nm_per_rad(double fixture_N_per_m, const Pose& X_HT) {
  const Vec3 needle = zAxis(X_HT.q);
  double worst = 0;
  constexpr int kSteps = 180;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; j < 2 * kSteps; ++j) {
      const double up = std::numbers::pi * i / kSteps, around = std::numbers::pi * j / kSteps;
      const Vec3 axis{std::sin(up) * std::cos(around), std::sin(up) * std::sin(around), std::cos(up)};
      const Vec3 way_m = cross(axis, X_HT.p);
      const double along_m = dot(way_m, needle);
      worst = std::max(worst, fixture_N_per_m * (normSquared(way_m) - along_m * along_m) +
                                  kAxial_N_per_m * along_m * along_m);
    }
  return worst;
}

TEST(HandleStiffness, aStraightLeverTurnsTheFixtureIntoItsSquare) {
  const HandleStiffness of = handleStiffness(sceneOf(400, 0), kAxial_N_per_m, straight(0.13));
  EXPECT_DOUBLE_EQ(of.across_N_per_m, 400);
  EXPECT_NEAR(of.handle_Nm_per_rad, 6.76, 1e-12);
}

TEST(HandleStiffness, ofAnyToolIsThatOfTheWorstAxis) {
  const Quat turned = normalized(Quat{0.3, -0.2, 0.1, 1});
  for (const Pose& tool : {straight(0.13), Pose{{0.012, -0.008, 0.142}, {}}, Pose{{0.1, 0, 0.02}, {}},
                           Pose{{0.05, 0.02, 0.09}, turned}}) {
    const double worst = worstTurn_Nm_per_rad(400, tool);
    EXPECT_NEAR(handleStiffness(sceneOf(400, 0), kAxial_N_per_m, tool).handle_Nm_per_rad, worst,
                2e-3 * worst);
  }
}

TEST(HandleStiffness, effectsThatAreNotLiveHaveNone) {
  SceneSpec scene = sceneOf(400, 0.5);
  scene.effects &= ~(bitOf(Effect::kClamping) | bitOf(Effect::kOrientationLimit));
  EXPECT_EQ(handleStiffness(scene, kAxial_N_per_m, straight(0.13)).handle_Nm_per_rad, 0);
  EXPECT_EQ(heldStiffnessShare(scene, kAxial_N_per_m, {}, straight(0.5)), 1);
  scene = sceneOf(400, 0.5);
  scene.orientation_limit.max_torque_Nm = 0;
  EXPECT_EQ(handleStiffness(scene, kAxial_N_per_m, {}).turning_Nm_per_rad, 0);
}

TEST(HandleStiffness, boneHoldsANeedleSidewaysNextToTheFixture) {
  SceneSpec scene = sceneOf(400, 0);
  scene.effects |= bitOf(Effect::kBone);
  double& bone = scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m];
  bone = 600;
  EXPECT_NEAR(handleStiffness(scene, 600, straight(0.1)).handle_Nm_per_rad, 4, 1e-12) << "no layer of it";
  scene.layers.back().is_bone = true;
  EXPECT_NEAR(handleStiffness(scene, 600, straight(0.1)).handle_Nm_per_rad, 10, 1e-12);
  EXPECT_NEAR(heldStiffnessShare(scene, 600, {}, straight(0.08)), 4 / 6.4, 1e-12);
  lowerStiffness(scene, {.lever = 0.5});
  EXPECT_EQ(bone, 300);
}

// a tip deeper than its needle's length is not stopped
TEST(HandleStiffness, aShortNeedleReachesTheFixturesGreatest) {
  SceneSpec scene = sceneOf(400, 0);
  scene.needle_length_m = 0.01;
  const auto model = compile(scene, 1000);
  ASSERT_TRUE(model.ok()) << model.error().message;
  SimState state{};
  StepReport report;
  double steepest = 0;
  for (int k = -10; k <= 500; ++k) {
    step(*model, {{0, 0, -1e-4 * k}, {1, 0, 0, 0}}, state, report);
    steepest = std::max(steepest, report.clamping_stiffness_N_per_m);
  }
  EXPECT_NEAR(steepest, 400, 1e-9);
  EXPECT_NEAR(handleStiffness(scene, 0, {}).across_N_per_m, steepest, 1e-9);
}

TEST(HandleStiffness, withoutLateralStiffnessThereIsNoFixture) {
  SceneSpec scene = sceneOf(400, 0);
  for (LayerSpec& layer : scene.layers) layer.lateral_stiffness_N_per_m2 = 0;
  EXPECT_EQ(handleStiffness(scene, 0, straight(0.2)).handle_Nm_per_rad, 0);
}

// 0.5 N·m/rad and 400 N/m · 0.13² = 7.26 N·m/rad, of which the Desktop renders 4
TEST(HeldStiffnessShare, isWhatTheDeviceHoldsOverWhatTheSceneIs) {
  EXPECT_NEAR(heldStiffnessShare(sceneOf(400, 0.5), kAxial_N_per_m, {}, straight(0.13)), 4 / 7.26, 1e-12);
  EXPECT_EQ(heldStiffnessShare(sceneOf(400, 0.5), kAxial_N_per_m, {}, straight(0.09)), 1);
  // at the tip alone
  DeviceLimits soft;
  soft.max_stiffness_N_per_m = 300;
  EXPECT_NEAR(heldStiffnessShare(sceneOf(400, 0.5), kAxial_N_per_m, soft, {}), 0.75, 1e-12);
  EXPECT_NEAR(heldStiffnessShare(sceneOf(400, 5), kAxial_N_per_m, {}, {}), 0.8, 1e-12);
}

TEST(HeldStiffnessShare, wallsFarOffTheAxisLeaveNothing) {
  EXPECT_EQ(heldStiffnessShare(sceneOf(400, 0), kAxial_N_per_m, {}, {{0.08, 0, 0}, {}}), 0)
      << "700 N/m · 0.08² are 4.5 N·m/rad";
}

TEST(LowerStiffness, whatIsLoweredIsHeld) {
  for (const Pose& tool : {straight(0.13), Pose{{0.012, -0.008, 0.142}, {}}, Pose{{0.06, 0, 0.1}, {}}}) {
    SceneSpec scene = sceneOf(600, 0.5);
    const double share = heldStiffnessShare(scene, kAxial_N_per_m, {}, tool);
    ASSERT_LT(share, 1);
    lowerStiffness(scene, {.lever = share});
    EXPECT_NEAR(handleStiffness(scene, kAxial_N_per_m, tool).handle_Nm_per_rad, 4, 1e-9);
    EXPECT_NEAR(heldStiffnessShare(scene, kAxial_N_per_m, {}, tool), 1, 1e-12);
  }
}

TEST(LowerStiffness, theEngineRendersNoMoreThanTheLoweredStiffness) {
  SceneSpec scene = sceneOf(400, 0.5);
  lowerStiffness(scene, {.lever = 0.55});
  const auto model = compile(scene, 1000);
  ASSERT_TRUE(model.ok()) << model.error().message;
  SimState state{};
  StepReport report;
  const Quat down{1, 0, 0, 0};
  double steepest = 0;
  for (int k = -10; k <= 500; ++k) {
    step(*model, {{0.001, 0, -1e-4 * k}, down}, state, report);
    steepest = std::max(steepest, report.clamping_stiffness_N_per_m);
  }
  EXPECT_NEAR(steepest, 220, 1e-9);
}

TEST(LowerStiffness, allOfItChangesNothing) {
  SceneSpec scene = sceneOf(400, 0.5);
  lowerStiffness(scene, {});
  EXPECT_EQ(scene.virtual_fixture.max_stiffness_N_per_m, 400);
  EXPECT_EQ(scene.orientation_limit.stiffness_Nm_per_rad, 0.5);
}

TEST(StiffnessShareText, namesTheReductionInTheProfilesTerms) {
  EXPECT_EQ(stiffnessShareText({}, 0), "");
  EXPECT_EQ(
      stiffnessShareText({.lever = 0.551}, 0),
      "Fixture, bone, palpation and orientation limit were rendered at 55 % of the profile's stiffness. This "
      "device and tool cannot hold more.");
  EXPECT_EQ(
      stiffnessShareText({.lever = 0.551}, bitOf(Effect::kBone)),
      "Bone was left out: the needle cut it as it cuts a layer of tissue. Fixture, palpation and orientation "
      "limit were rendered at 55 % of the profile's stiffness. This device and tool cannot hold more.");
  EXPECT_EQ(stiffnessShareText({.delay = 0.758}, 0),
            "Because the device's force comes late, what acts along the needle was rendered at 76 % of the "
            "profile's stiffness: the tissue's forces are the same, over a longer way.");
  EXPECT_EQ(stiffnessShareText({}, bitOf(Effect::kBone)),
            "Bone was left out: the needle cut it as it cuts a layer of tissue. This device and tool cannot "
            "hold more.");
}

}  // namespace
}  // namespace needlelab::test
