// Shaft friction (FORCE_MODEL.md, "Shaft friction") by formula.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

SceneSpec frictionScene() {
  return withEffects(allEffects(), bitOf(Effect::kShaftFriction));
}

// ∫₀^{d_t} friction ds for a straight needle along the normal over c
double frictionAt(const SceneSpec& scene, double depth, double c) {
  double sum = 0;
  for (std::size_t i = 0; i < scene.layers.size() && depth > 0; ++i) {
    const double here = i + 1 == scene.layers.size() ? depth : std::min(depth, scene.layers[i].thickness_m);
    sum += scene.layers[i].friction_N_per_m * here / c;
    depth -= here;
  }
  return sum;
}

TEST(ShaftFriction, isTheIntegralOverInsertedLengthBothWays) {
  const SceneSpec scene = frictionScene();
  for (const double tangent : {0.0, 0.6}) {
    const Vec3 axis = tilted({0, 0, -1}, tangent, {0, 1, 0});
    const double c = -axis.z;
    EngineRun run(scene, 1000);
    int in = 0, out = 0;
    for (const auto& sample : insertHoldWithdraw(1000, defaultSite(), axis, axis, 0.04, 0.02, 0.05)) {
      const StepReport report = run.step(sample);
      const double full = frictionAt(scene, -sample.p_WT_m.z, c);
      ASSERT_LE(std::abs(report.friction_N), full + 1e-9);
      // sliding, a few millimetres after each change of direction (Δ_f = full/140 each way)
      if (report.speed_mps > 0.0199 && report.insertion_m > 0.002) {
        ASSERT_NEAR(report.friction_N, -full, 1e-9);
        ++in;
      }
      if (report.phase == Phase::kWithdrawing && report.insertion_m < 0.04 - 2 * 0.9 / 140 && full > 0) {
        ASSERT_NEAR(report.friction_N, full, 1e-9);
        ++out;
      }
    }
    EXPECT_GT(in, 500);
    EXPECT_GT(out, 500);
  }
}

// the ramp of a stop: linear, and nothing is left; after a withdrawal, too
TEST(ShaftFriction, relaxesInAStopUntilNothingIsLeft) {
  for (const double depth_m : {0.03, 0.015}) {
    Probe probe(frictionScene(), 1000);
    probe.at(-0.001);
    probe.go(500, 0.03);
    if (depth_m < 0.03) probe.go(500, depth_m);
    const double gliding = probe.last().friction_N;
    ASSERT_GT(std::abs(gliding), 0.15);
    double before_N = gliding;
    for (const auto& report : probe.stay(3000)) {
      ASSERT_LE(std::abs(report.friction_N), std::abs(before_N) + 1e-12);
      ASSERT_LE(std::abs(report.friction_N - before_N), 140 * 1.5 * 0.003 * 1e-3 + 1e-12) << "no step";
      before_N = report.friction_N;
    }
    EXPECT_EQ(before_N, 0);
    probe.go(2000, depth_m + (depth_m < 0.03 ? -0.01 : 0.01));
    EXPECT_GT(std::abs(probe.last().friction_N), 0.05) << "and it builds up again";
  }
}

TEST(ShaftFriction, reversesThroughItsSpring) {
  Probe probe(frictionScene(), 1000);
  probe.at(-0.001);
  probe.go(500, 0.03);
  const double before = probe.last().friction_N;
  for (int i = 1; i <= 20; ++i) {
    const double back = 5e-5 * i;
    ASSERT_NEAR(probe.at(0.03 - back).friction_N, before + 140 * back, 1e-9);
  }
}

TEST(ShaftFriction, vanishesAtTheSkin) {
  Probe probe(frictionScene(), 1000);
  probe.at(-0.001);
  probe.go(500, 0.02);
  for (const auto& report : probe.go(2000, 1e-5))
    ASSERT_LE(std::abs(report.friction_N), frictionAt(frictionScene(), report.depth_m, 1) + 1e-12);
}

TEST(ShaftFriction, givesNoEnergy) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    GestureRange slow;
    slow.least_leg_s = 0.6;
    slow.most_leg_s = 1.2;
    const Motion motion = randomGesture(seed, 4000, defaultSite(), slow);
    EngineRun run(frictionScene(), 4000);
    EXPECT_LE(forceWork(motion, run.run(motion)), 1e-6) << seed;
  }
}

}  // namespace
}  // namespace needlelab::test
