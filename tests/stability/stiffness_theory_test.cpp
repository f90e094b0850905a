// Compares the theoretical bounds with each other and with the loop itself.
#include "client/sim/stability/loop/stiffness_theory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace needlelab {
namespace {

// the same loop by brute force: exact motion of mass, spring and damper over a tick in many short steps of a
// fourth-order method; the wall is sampled and held, d ticks late. Returns how much the swing grows over the
// second half
double growth(const LinearLoop& loop, double stiffness_N_per_m) {
  constexpr int kSteps = 20, kTicks = 8000;
  const double h = loop.period_s / kSteps;
  std::vector<double> forces(loop.delay_ticks + 1, 0.0);
  double x = 1, v = 0, before = 1, first = 0, second = 0;
  const auto a = [&](double at, double speed, double force) {
    return (force - loop.stiffness_N_per_m * at - loop.damping_Ns_per_m * speed) / loop.mass_kg;
  };
  for (int tick = 0; tick < kTicks; ++tick) {
    const std::size_t slots = forces.size();
    forces[(tick + loop.delay_ticks) % slots] =
        -stiffness_N_per_m * x - loop.wall_damping_Ns_per_m * (x - before) / loop.period_s;
    before = x;
    const double force = forces[tick % slots];
    for (int i = 0; i < kSteps; ++i) {
      const double v1 = a(x, v, force), x1 = v;
      const double v2 = a(x + h / 2 * x1, v + h / 2 * v1, force), x2 = v + h / 2 * v1;
      const double v3 = a(x + h / 2 * x2, v + h / 2 * v2, force), x3 = v + h / 2 * v2;
      const double v4 = a(x + h * x3, v + h * v3, force), x4 = v + h * v3;
      x += h / 6 * (x1 + 2 * x2 + 2 * x3 + x4);
      v += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    }
    (tick < kTicks / 2 ? first : second) += x * x;
  }
  return second / first;
}

TEST(StiffnessTheory, theColgateSchenkelBoundIsAFastLoopsLinearLimit) {
  for (const unsigned delay : {0u, 1u, 2u, 3u})
    for (const double rate : {1000.0, 4000.0, 16'000.0}) {
      LinearLoop loop;
      loop.period_s = 1 / rate;
      loop.delay_ticks = delay;
      const double bound = passiveStiffnessLimit(loop.damping_Ns_per_m, loop.period_s, delay);
      // the bound omits terms of T: 9 N/m here, at every rate
      EXPECT_NEAR(sampledStiffnessLimit(loop), bound, 15) << rate << " Hz, " << delay << " ticks late";
      EXPECT_GE(sampledStiffnessLimit(loop), bound);
    }
}

TEST(StiffnessTheory, theLinearLimitParksBetweenDecayAndGrowth) {
  for (const unsigned delay : {0u, 1u, 3u})
    for (const double damping : {0.0, 2.0}) {
      LinearLoop loop;
      loop.delay_ticks = delay;
      loop.wall_damping_Ns_per_m = damping;
      const double limit = sampledStiffnessLimit(loop);
      ASSERT_TRUE(std::isfinite(limit));
      EXPECT_LT(growth(loop, 0.97 * limit), 1) << delay << " ticks late, B " << damping;
      EXPECT_GT(growth(loop, 1.03 * limit), 1) << delay << " ticks late, B " << damping;
    }
}

TEST(StiffnessTheory, dampersBehindALeverGiveWayOneAfterTheOther) {
  EXPECT_EQ(dampingAcross(3.5, 0.06, 0), 3.5);
  EXPECT_NEAR(dampingAcross(3.5, 0.06, 0.13), 1 / (1 / 3.5 + 0.0169 / 0.06), 1e-12);
  EXPECT_EQ(dampingAcross(3.5, 0, 0.13), 0);
}

}  // namespace
}  // namespace needlelab
