#include <gtest/gtest.h>

#include "common/scoring/measure_table.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

TEST(Actions, movementsArePartedByRest) {
  // three movements of 30 mm within 1 s each, rests of 0.5 s between; the last of 1 mm is none
  const auto samples = gesture(1000, 7, [](double t, GestureSample& s) {
    const double x = 0.03 * (ease(t, 1) + ease(t - 1.5, 1) - ease(t - 3, 1)) + 0.001 * ease(t - 5, 0.3);
    setTip(s, {x, 0, 0.1});
  });
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  EXPECT_EQ(valueOf(score, "translational_actions"), 3);
  EXPECT_EQ(valueOf(score, "rotational_actions"), 0);
}

TEST(Actions, aShortHesitationPartsNothing) {
  // 40 mm/s with stops of 50 ms: shorter than the pause that parts, and blurred by the filter
  const auto samples = gesture(1000, 2, [](double t, GestureSample& s) {
    const double cycle = std::floor(t / 0.5), within = t - 0.5 * cycle;
    setTip(s, {0.04 * (0.45 * cycle + std::min(within, 0.45)), 0, 0.1});
  });
  EXPECT_EQ(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "translational_actions"), 1);
}

TEST(Actions, turnsOfTheAxisCountAndRollingDoesNot) {
  const auto turned = [](bool roll) {
    const auto samples = gesture(1000, 5, [&](double t, GestureSample& s) {
      const double angle = 0.3 * (ease(t - 0.5, 1) - ease(t - 2.5, 1));
      setDown(s, roll ? 0 : angle);
      if (!roll) return;
      const Quat q =
          Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]} * Quat{0, 0, std::sin(angle), std::cos(angle)};
      s.q_WT[0] = q.x, s.q_WT[1] = q.y, s.q_WT[2] = q.z, s.q_WT[3] = q.w;
    });
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "rotational_actions");
  };
  EXPECT_EQ(turned(false), 2);
  EXPECT_EQ(turned(true), 0);
}

TEST(Actions, tremorAtRestIsNoMovement) {
  for (const double amplitude_m : {50e-6, 200e-6}) {
    const auto samples = gesture(1000, 5, [&](double t, GestureSample& s) {
      setTip(s, {amplitude_m * std::sin(2 * std::acos(-1.0) * 9 * t), 0, 0.1});
    });
    EXPECT_EQ(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "translational_actions"), 0)
        << amplitude_m;
  }
}

TEST(Actions, workAgainstASpringAcrossTheNeedle) {
  // 400 N/m aside: out by 5 mm and back. ½·k·d² once: what the spring gives back is not taken off. The forces
  // along the needle, and the way along it, do no such work.
  const auto work = [](double friction_N, double way_m) {
    const auto samples = gesture(1000, 4, [&](double t, GestureSample& s) {
      const double y = 0.005 * (ease(t, 1.5) - ease(t - 2, 1.5));
      setDepth(s, 0.02);
      setTip(s, {0, y, -0.02 - way_m * ease(t, 4)});
      s.force_W_N[1] = -400 * y;
      s.force_W_N[2] = friction_N;
    });
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "clamping_work_j");
  };
  const double spring_J = 0.5 * 400 * 0.005 * 0.005;
  EXPECT_NEAR(work(0, 0), spring_J, 0.01 * spring_J);
  EXPECT_NEAR(work(8, 0.008), spring_J, 0.01 * spring_J);
  // outside of tissue there is none
  const auto outside = gesture(1000, 4, [](double t, GestureSample& s) {
    setTip(s, {0, 0.005 * ease(t, 4), 0.1});
    s.force_W_N[1] = -2;
  });
  EXPECT_EQ(valueOf(scoreGesture(outside, 1000, halfSpace(), {}), "clamping_work_j"), 0);
}

TEST(Tissue, meanForceOfEachLayer) {
  // 1, 2, 3 N by layer
  const auto score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {});
  EXPECT_NEAR(valueOf(score, "mean_force_layer_1_n"), 1, 1e-9);
  EXPECT_NEAR(valueOf(score, "mean_force_layer_2_n"), 2, 1e-9);
  EXPECT_NEAR(valueOf(score, "mean_force_layer_3_n"), 3, 1e-9);
  EXPECT_EQ(find(score, "mean_force_layer_2_n")->words, "Mean force in layer 2 (MUSCLE) 2 N");
  // a layer that was never reached has no mean
  const auto shallow = gesture(1000, 1, [](double, GestureSample& s) { setDepth(s, 0.005); });
  EXPECT_EQ(find(scoreGesture(shallow, 1000, halfSpace(), {}), "mean_force_layer_2_n"), nullptr);
}

}  // namespace
}  // namespace needlelab
