// A hand that somebody steers: how its aim goes after wishes, on virtual time, and what the hand then does.
#include "client/device/steered_aim.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "client/device/hand_plan_choice.h"
#include "client/device/simulated_device.h"

namespace needlelab {
namespace {

constexpr double kStep_s = 50e-6;
constexpr double kRate_hz = 1000;

struct SteeredRun {
  std::shared_ptr<HandSteering> steering = std::make_shared<HandSteering>();
  SteeredAim aim{steering, {{{0, 0, 0.03}, {}}, 0.1}, kStep_s};
  double peak_mps = 0, peak_radps = 0;
  HandAim now{{{0, 0, 0.03}, {}}, 0.1};

  void wish(Vec3 p, Quat q = {}, double plunger = 0.1) { steering->wish({{p, q}, plunger}); }
  void go(double seconds) {
    for (double t = 0; t < seconds; t += kStep_s) {
      const HandAim next = aim.next();
      peak_mps = std::max(peak_mps, norm(next.X_WT.p - now.X_WT.p) / kStep_s);
      const Quat d = next.X_WT.q * conjugate(now.X_WT.q);
      peak_radps = std::max(peak_radps, 2 * norm(Vec3{d.x, d.y, d.z}) / kStep_s);
      now = next;
    }
  }
};

TEST(SteeredAim, withoutAWishItStaysWhereItBegan) {
  SteeredRun run;
  run.go(1);
  EXPECT_EQ(run.now.X_WT.p, (Vec3{0, 0, 0.03}));
  EXPECT_EQ(run.now.plunger, 0.1);
}

TEST(SteeredAim, aWishIsReachedWithoutOvershoot) {
  SteeredRun run;
  run.wish({0, 0, 0.02});
  double lowest = 1;
  for (int i = 0; i < 40; ++i) {
    run.go(0.05);
    lowest = std::min(lowest, run.now.X_WT.p.z);
  }
  EXPECT_NEAR(run.now.X_WT.p.z, 0.02, 1e-8);
  EXPECT_GT(lowest, 0.02 - 1e-7);
}

TEST(SteeredAim, aJumpOfTheWishIsGoneAfterAtTheGreatestSpeedAtMost) {
  SteeredRun run;
  run.wish({0.5, 0, 0.03});
  run.go(1);
  EXPECT_LE(run.peak_mps, kMostAimSpeed_mps * (1 + 1e-9));
  EXPECT_GT(run.peak_mps, 0.99 * kMostAimSpeed_mps);
  // speeding up costs the smoothing's 25 ms
  EXPECT_NEAR(run.now.X_WT.p.x, kMostAimSpeed_mps * (1 - 0.025), 1e-4);
}

TEST(SteeredAim, aTurnIsGoneAfterAtTheGreatestTurnAtMostAndStaysARotation) {
  SteeredRun run;
  const double half = 0.6;
  run.wish({0, 0, 0.03}, {std::sin(half), 0, 0, std::cos(half)});
  run.go(3);
  EXPECT_LE(run.peak_radps, kMostAimTurn_radps * (1 + 1e-6));
  EXPECT_GT(run.peak_radps, 0.9 * kMostAimTurn_radps);
  EXPECT_NEAR(run.now.X_WT.q.x, std::sin(half), 1e-6);
  EXPECT_NEAR(dot(run.now.X_WT.q, run.now.X_WT.q), 1, 1e-12);
}

TEST(SteeredAim, stepsOfThirtyFramesASecondComeOutAsAnEvenMovement) {
  // 20 mm/s, wished in steps of 0.67 mm
  SteeredRun run;
  const double frame_s = 1.0 / 30;
  for (int i = 1; i <= 15; ++i) {
    run.wish({0, 0, 0.03 - 0.02 * i * frame_s});
    run.go(frame_s);
  }
  run.peak_mps = 0;
  double slowest = 1;
  for (int i = 16; i <= 30; ++i) {
    run.wish({0, 0, 0.03 - 0.02 * i * frame_s});
    for (int k = 0; k < 10; ++k) {
      const Vec3 before = run.now.X_WT.p;
      run.go(frame_s / 10);
      slowest = std::min(slowest, norm(run.now.X_WT.p - before) / (frame_s / 10));
    }
  }
  EXPECT_LT(run.peak_mps, 0.025);
  EXPECT_GT(slowest, 0.015);
}

TEST(SteeredAim, thePlungerGoesNoFasterThanAThumb) {
  SteeredRun run;
  run.wish({0, 0, 0.03}, {}, 1);
  run.go(0.5);
  EXPECT_NEAR(run.now.plunger, 0.1 + 0.5 * kMostPlungerSpeed_per_s, 1e-4);
  run.go(2);
  EXPECT_EQ(run.now.plunger, 1);
}

TEST(SteeredAim, aWishThatIsNoPoseIsPassedOver) {
  SteeredRun run;
  run.wish({0, 0, std::numeric_limits<double>::quiet_NaN()});
  run.go(0.1);
  run.wish({0, 0, 0}, {0, 0, 0, 2});
  run.go(0.1);
  run.wish({0, 0, 0}, {}, std::numeric_limits<double>::infinity());
  run.go(0.1);
  EXPECT_EQ(run.now.X_WT.p, (Vec3{0, 0, 0.03}));
  EXPECT_EQ(run.now.plunger, 0.1);
}

SceneSpec flatScene() {
  SceneSpec scene;
  scene.limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  scene.needle_length_m = 0.06;
  return scene;
}

TEST(SteeredStart, isOutsideBesideTheMarkedEntryAndLooksIn) {
  const std::vector<PlanTarget> targets = {{"deep", {0.01, 0, -0.03}, Vec3{0.01, 0, 0}}};
  const HandAim start = steeredStart(flatScene(), targets).start();
  EXPECT_NEAR(start.X_WT.p.z, 0.03, 1e-12);
  EXPECT_NEAR(norm(start.X_WT.p - Vec3{0.01, 0, 0.03}), 0.015, 1e-12);
  EXPECT_NEAR(zAxis(start.X_WT.q).z, -1, 1e-12);
  EXPECT_GT(start.plunger, 0) << "one can aspirate";
  EXPECT_NEAR(steeredStart(flatScene(), {}).start().X_WT.p.x, 0, 1e-12) << "the limb's reference point";
}

TEST(HandPlanChoice, pointerIsNoPlanToFollow) {
  HandOptions options;
  options.plan = kPointerPlan;
  const auto plan = choosePlan(options, flatScene(), {});
  ASSERT_FALSE(plan.ok());
  EXPECT_NE(plan.error().message.find("window"), std::string::npos);
}

TEST(SteeredHand, goesWhereItIsSteeredFeelsResistanceAndNeverFinishes) {
  SimulatedDeviceOptions options;
  options.steering = std::make_shared<HandSteering>();
  options.hand.tremor_m = 0;
  SimulatedDevice device(options, steeredStart(flatScene(), {}));
  ASSERT_TRUE(device.open(kRate_hz).ok());
  DeviceReading reading;
  ASSERT_EQ(device.read(reading), DeviceRead::kFresh);
  const Vec3 start = reading.X_WH.p;
  EXPECT_NEAR(reading.plunger, kPlungerBeforeAspiration, 1e-12);

  options.steering->wish({{start - Vec3{0, 0, 0.01}, reading.X_WH.q}, 0});
  for (int i = 0; i < 3000; ++i) ASSERT_EQ(device.read(reading), DeviceRead::kFresh);
  EXPECT_NEAR(reading.X_WH.p.z, start.z - 0.01, 1e-4);
  EXPECT_EQ(reading.plunger, 0);
  EXPECT_NEAR(device.hand().wanted().p.z, start.z - 0.01, 1e-6);
}

}  // namespace
}  // namespace needlelab
