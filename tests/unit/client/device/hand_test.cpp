#include "client/device/hand.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

HandOptions steady() {
  HandOptions options;
  options.tremor_m = 0;
  return options;
}

TEST(Hand, pullsBySpringAndDamper) {
  const Pose there{{0.1, 0, 0}, {}};
  Hand hand(steady(), HandPlan(there).hold(1), {}, 1e-3);
  // 300 N/m over (2, −1, 0) mm, 3 N·s/m against 0.1 m/s
  const Wrench w = hand.pull({{{0.098, 0.001, 0}, {}}, {0, 0, 0.1}, {}});
  EXPECT_NEAR(w.force_N.x, 0.6, 1e-12);
  EXPECT_NEAR(w.force_N.y, -0.3, 1e-12);
  EXPECT_NEAR(w.force_N.z, -0.3, 1e-12);
  EXPECT_EQ(w.torque_Nm, Vec3{});
}

TEST(Hand, turnsTheHandleBackTheShortWay) {
  Hand hand(steady(), HandPlan(Pose{}).hold(1), {}, 1e-3);
  for (const double sign : {1.0, -1.0}) {  // q and −q are the same rotation
    const double a = 0.2;
    const Quat q{std::sin(a / 2) * sign, 0, 0, std::cos(a / 2) * sign};
    const Wrench w = hand.pull({{{}, q}, {}, {0, 0.5, 0}});
    EXPECT_NEAR(w.torque_Nm.x, -2 * 2 * std::sin(a / 2), 1e-12);
    EXPECT_NEAR(w.torque_Nm.y, -0.05 * 0.5, 1e-12);
    EXPECT_NEAR(w.torque_Nm.z, 0, 1e-12);
  }
}

TEST(Hand, pursuesThePlanWithTheTipOfTheTool) {
  // a tool of 150 mm, bent by a quarter turn about x
  const Pose X_HT{{0, 0.02, 0.15}, {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}};
  const Pose start{{0.3, 0.1, 0.2}, orientationAlong({0.1, 0.2, -1})};
  const Pose deep{{0.3, 0.12, 0.1}, orientationAlong({0, 0.1, -1})};
  const HandPlan plan = HandPlan(start).moveTo(deep, 0.05, Motion::kMinJerk);
  Hand hand(steady(), plan, X_HT, 1e-3);
  EXPECT_LT(norm((hand.startPose() * X_HT).p - start.p), 1e-15);
  for (int k = 0; !hand.finished(); ++k) {
    hand.pull({});
    const Pose tip = hand.wanted() * X_HT, aim = plan.at(k * 1e-3).X_WT;
    ASSERT_LT(norm(tip.p - aim.p), 1e-12);
    ASSERT_GT(std::abs(dot(tip.q, aim.q)), 1 - 1e-12);
  }
}

TEST(Hand, letsGoAtItsTimeForGood) {
  HandOptions o;
  o.tremor_m = 0;
  o.let_go_s = 0.01;
  Hand hand(o, HandPlan(Pose{}).moveIn(Pose{{0.1, 0, 0}, {}}, 0.1, Motion::kLinear).hold(1), {}, 1e-3);
  const HandleState at_rest{};
  for (int step = 0; step < 200; ++step) {
    const Wrench pull = hand.pull(at_rest);
    if (step == 0) continue;  // it begins where the handle is
    EXPECT_EQ(norm(pull.force_N) > 0, step < 10) << "step " << step;
    EXPECT_NEAR(hand.wanted().p.x, std::min(0.1, 1e-3 * step), 1e-9);  // the plan goes on
  }
}

TEST(Hand, doesItsPlanAsOftenAsAsked) {
  HandOptions options = steady();
  options.repeat = 3;
  const HandPlan plan =
      HandPlan(Pose{}).moveIn({{0, 0, 1}, {}}, 0.5, Motion::kLinear).moveIn({}, 0.5, Motion::kLinear);
  Hand hand(options, plan, {}, 1.0 / 1024);
  int steps = 0, tops = 0;
  for (double before = 0; !hand.finished(); ++steps) {
    hand.pull({});
    const double z = hand.wanted().p.z;
    if (before < 0.75 && z >= 0.75) ++tops;
    before = z;
  }
  EXPECT_EQ(steps, 3 * 1024);
  EXPECT_EQ(tops, 3);

  options.repeat = 0;
  Hand endless(options, plan, {}, 1.0 / 1024);
  for (int i = 0; i < 50 * 1024; ++i) endless.pull({});
  EXPECT_FALSE(endless.finished());
}

}  // namespace
}  // namespace needlelab
