// How mouse and keys become steering commands, in numbers.
#include <gtest/gtest.h>

#include <cmath>

#include "client/device/hand/hand_plan.h"
#include "client/station/window/screens/pointer_steering.h"

namespace needlelab {
namespace {

constexpr Vec3 kTip{0.01, 0.02, 0.03};
// a person at +x who looks slightly down: y to the right
const SteerView kFromX{{0, 1, 0}, normalized(Vec3{-0.3, 0, 1})};

SteeringTarget upright() {
  return {{kTip, orientationAlong({0, 0, -1})}, 0.1};
}

struct Steered {
  PointerSteering steering{upright()};
  Vec3 moved(const SteerInput& input, const SteerView& view = kFromX) {
    return steering.update(input, view, kTip).X_WT.p - kTip;
  }
};

void expectNear(Vec3 found, Vec3 expected) {
  EXPECT_NEAR(found.x, expected.x, 1e-9);
  EXPECT_NEAR(found.y, expected.y, 1e-9);
  EXPECT_NEAR(found.z, expected.z, 1e-9);
}

TEST(PointerSteering, withoutAHandOnItNothingMoves) {
  Steered s;
  SteerInput input;
  input.dt_s = 0.1;
  expectNear(s.moved(input), {});
  EXPECT_EQ(s.steering.target().plunger, 0.1);
}

TEST(PointerSteering, keysAndWheelAdvanceAlongTheNeedle) {
  Steered s;
  SteerInput input;
  input.dt_s = 0.05;
  input.advance = 1;
  expectNear(s.moved(input), {0, 0, -PointerSteering::kAdvance_mps * 0.05});
  input = {};
  input.wheel = -2;
  Steered back;
  expectNear(back.moved(input), {0, 0, 2 * PointerSteering::kWheel_m});
}

TEST(PointerSteering, aTiltedNeedleAdvancesAlongItself) {
  const Vec3 axis = normalized(Vec3{0, 0.5, -1});
  PointerSteering steering({{kTip, orientationAlong(axis)}, 0});
  SteerInput input;
  input.wheel = 3;
  expectNear(steering.update(input, kFromX, kTip).X_WT.p - kTip, axis * (3 * PointerSteering::kWheel_m));
}

TEST(PointerSteering, dragsMoveAcrossToTheRightAndAwayAsSeen) {
  Steered s;
  SteerInput input;
  input.across_right_px = 50;
  expectNear(s.moved(input), {0, 50 * PointerSteering::kAcross_m_per_px, 0});
  Steered t;
  input = {};
  input.across_up_px = 20;
  // the person is at +x: away is −x, and the needle keeps its height
  expectNear(t.moved(input), {-20 * PointerSteering::kAcross_m_per_px, 0, 0});
  // from the other side, both directions are reversed
  Steered u;
  expectNear(u.moved(input, {{0, -1, 0}, normalized(Vec3{0.3, 0, 1})}),
             {20 * PointerSteering::kAcross_m_per_px, 0, 0});
}

TEST(PointerSteering, seenFromAboveUpInThePictureIsAway) {
  Steered s;
  SteerInput input;
  input.across_up_px = 10;
  expectNear(s.moved(input, {{0, 1, 0}, {-1, 0, 0}}), {-10 * PointerSteering::kAcross_m_per_px, 0, 0});
}

TEST(PointerSteering, tiltTakesTheSyringeToThatSideAboutTheTip) {
  Steered s;
  SteerInput input;
  input.tilt_right_px = 100;
  const SteeringTarget& target = s.steering.update(input, kFromX, kTip);
  const double angle = 100 * PointerSteering::kTilt_rad_per_px;
  expectNear(target.X_WT.p, kTip);
  // the hub is at −axis: to the right is +y
  expectNear(-zAxis(target.X_WT.q), {0, std::sin(angle), std::cos(angle)});
  EXPECT_NEAR(dot(target.X_WT.q, target.X_WT.q), 1, 1e-12);
}

TEST(PointerSteering, thePlungerGoesWhileItIsHeldAndStaysWithinItsWay) {
  Steered s;
  SteerInput input;
  input.dt_s = 0.1;
  input.press = true;
  s.moved(input);
  EXPECT_NEAR(s.steering.target().plunger, 0.1 + 0.1 * PointerSteering::kPress_per_s, 1e-12);
  input.press = false;
  input.draw = true;
  for (int i = 0; i < 20; ++i) s.moved(input);
  EXPECT_EQ(s.steering.target().plunger, 0);
}

TEST(PointerSteering, fineIsAQuarterOfEverything) {
  Steered s;
  SteerInput input;
  input.dt_s = 0.04;
  input.fine = true;
  input.advance = 1;
  input.across_right_px = 8;
  expectNear(s.moved(input),
             {0, 2 * PointerSteering::kAcross_m_per_px, -0.01 * PointerSteering::kAdvance_mps});
}

TEST(PointerSteering, aWindowThatStoodStillDoesNotJump) {
  Steered s;
  SteerInput input;
  input.dt_s = 30;
  input.advance = 1;
  expectNear(s.moved(input), {0, 0, -0.1 * PointerSteering::kAdvance_mps});
}

TEST(PointerSteering, theWishStaysOnItsLeash) {
  Steered s;
  SteerInput input;
  input.wheel = 100;
  expectNear(s.moved(input), {0, 0, -PointerSteering::kLeash_m});
  input.wheel = -1;
  expectNear(s.moved(input), {0, 0, -PointerSteering::kLeash_m + PointerSteering::kWheel_m});
}

}  // namespace
}  // namespace needlelab
