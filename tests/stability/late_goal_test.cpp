// Where half the stiffness or more is left, the hand gets no energy and the needle comes to rest.
#include <gtest/gtest.h>

#include <cstdio>
#include <span>

#include "tests/stability/patients.h"

namespace needlelab::late_goal {
namespace {

struct Loop {
  std::uint32_t delay_ticks;
  double lag_s, device_Ns_per_m, grip_Ns_per_m, grip_N_per_m;
};
// none of them tuned the control
constexpr Loop kLoops[] = {
    {2, 0, 0.5, 0.9, 700},    {3, 0, 1.0, 0.9, 120}, {3, 0, 1.7, 0, 60},    {3, 0, 1.7, 0.3, 200},
    {2, 2e-3, 1.7, 0.9, 250}, {4, 0, 1.7, 0, 150},   {4, 0, 1.7, 0.9, 500}, {4, 0, 1.7, 3, 900},
    {6, 0, 3.0, 0.3, 75},     {6, 0, 3.0, 0.9, 350}, {5, 0, 1.7, 0.9, 180}, {4, 0, 1.0, 3, 300},
    {8, 0, 1.7, 0, 400},      {4, 0, 0.5, 0.3, 120},
};
struct Outcome {
  double share = 1, second_J = 0, swing_N = 0;
};

// The needle goes in 25 mm, straight, by 3 N of the hand's spring farther, and rests for 4 s.
Outcome outcomeOf(const Patient& patient, const Loop& loop, bool lowered, double capacity_J) {
  PlantOptions options;
  options.device.delay_ticks = loop.delay_ticks;
  options.device.lag_s = loop.lag_s;
  options.device.limits.damping_Ns_per_m = loop.device_Ns_per_m;
  options.device.hand.stiffness_N_per_m = loop.grip_N_per_m;
  options.device.hand.damping_Ns_per_m = loop.grip_Ns_per_m;
  options.passivity = passivityOf(options);
  options.passivity->capacity_J = capacity_J;
  const Vec3 in_W = -patient.out_W;
  const auto at = [&](double depth_m) {
    return Pose{patient.skin_W_m + in_W * depth_m, orientationAlong(in_W)};
  };
  HandPlan plan(at(-0.01));
  plan.hold(0.3).moveTo(at(0.025 + 3 / loop.grip_N_per_m), 0.05, Motion::kMinJerk);
  const double rest_s = plan.duration_s();
  plan.hold(4);
  const LateRun late = runOf(patient, plan, options, lowered);
  constexpr std::size_t kAround = 150;
  const auto swing = aboutSlowPart(forceAlong(ticksIn(late.run, {rest_s + 1, rest_s + 4}), in_W), kAround);
  return {late.share, *greatestInASecond_J(late.run.ticks, options.rate_hz),
          peakToPeak(std::span(swing).subspan(kAround, swing.size() - 2 * kAround))};
}

TEST(LateLoops, atHalfTheStiffnessOrMoreGiveNoEnergyAndComeToRest) {
  int held = 0, before = 0;
  for (const char* name : kPatients) {
    const Patient patient = patientOf(name);
    for (const Loop& loop : kLoops) {
      const Outcome now = outcomeOf(patient, loop, true, PassivitySettings{}.capacity_J);
      const Outcome was = outcomeOf(patient, loop, false, 0.5);
      std::printf(
          "%-24s D %u + %.0f ms, b %.1f, grip %.1f N·s/m %3.0f N/m: share %.2f; in a second %6.2f -> %5.2f mJ; "
          "at rest %5.2f -> %5.2f N\n",
          name, loop.delay_ticks, 1e3 * loop.lag_s, loop.device_Ns_per_m, loop.grip_Ns_per_m,
          loop.grip_N_per_m, now.share, 1e3 * was.second_J, 1e3 * now.second_J, was.swing_N, now.swing_N);
      if (now.share < kMinStiffnessShare) continue;
      ++held;
      before += was.second_J > 1e-3 || was.swing_N > 0.7;
      EXPECT_LE(now.second_J, 1e-3);
      if (loop.grip_Ns_per_m >= 0.9) EXPECT_LE(now.swing_N, 0.7);
    }
  }
  EXPECT_GE(held, 32);
  EXPECT_GE(before, 8) << "the full stiffness with a tank of 0.5 J";
}

}  // namespace
}  // namespace needlelab::late_goal
