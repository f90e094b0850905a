// HUB (FORCE_MODEL.md, "Hub"): a needle inserted to its hub goes no deeper.
#include <gtest/gtest.h>

#include <cmath>

#include "common/haptics/effects/effect_entry.h"
#include "tests/support/random.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr EffectMask kHubBit = bitOf(Effect::kHub);
constexpr double kLength_m = 0.020;

SceneSpec withHub(EffectMask others, double stiffness_N_per_m = 300) {
  SceneSpec scene = oneLayer(1, 0.3, 0.1);
  scene.effects = others | kHubBit;
  scene.needle_length_m = kLength_m;
  scene.stage_numbers[stageOf(Effect::kHub)][kHubStiffness_N_per_m] = stiffness_N_per_m;
  return scene;
}

double hubOf(const StepReport& report) {
  return effectEntry(Effect::kHub).value(report);
}

TEST(Hub, pushesOutByTheLengthBeyondTheNeedle) {
  EngineRun run(withHub(kAxial), 1000);
  const Site site = defaultSite();
  for (int i = 0; i <= 3000; ++i) {
    const double deep_m = -0.001 + i * 1e-5;
    const StepReport report = run.step({site.p_surface_m + site.inward * deep_m, pointing(site.inward)});
    const double beyond_m = std::max(0.0, deep_m - kLength_m);
    ASSERT_NEAR(hubOf(report), 300 * beyond_m, 1e-9) << deep_m;
    ASSERT_EQ((report.flags & kFlagBeyondNeedle) != 0, hubOf(report) > 0) << deep_m;
    ASSERT_NEAR(-dot(report.wrench_W.force_N, site.inward), 300 * beyond_m - report.cutting_N, 1e-9);
  }
}

TEST(Hub, actsAlongASlantedPathAndPastTheFarSide) {
  for (const LimbKind limb : kLimbKinds) {
    const Site site = siteOf(limb);
    for (const double degrees : {0.0, 40.0}) {
      const Vec3 axis = tilted(site.inward, degrees * kDegree, site.across_1);
      EngineRun run(withLimb(withHub(0), limb), 1000);
      StepReport report;
      for (int i = 0; i <= 1030; ++i)  // 100 mm: through the capsule's 90 mm
        report = run.step({site.p_surface_m + axis * (-0.003 + i * 1e-4), pointing(axis)});
      EXPECT_NEAR(hubOf(report), 300 * (0.1 - kLength_m), 1e-6) << limbName(limb) << degrees;
      const double max_N = std::min(300 * (0.1 - kLength_m), 10.0);  // the sum's limit
      EXPECT_NEAR(norm(report.wrench_W.force_N + axis * max_N), 0, 1e-6) << limbName(limb) << degrees;
    }
  }
}

TEST(Hub, returnsItsEnergyOverAnyClosedPath) {
  const Site site = defaultSite();
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(seed);
    SceneSpec scene = withHub(0);
    scene.max_force_N = 50;
    EngineRun run(scene, 1000);
    const auto at = [&](double deep_m, double aside_m) {
      return TipSample{site.p_surface_m + site.inward * deep_m + site.across_1 * aside_m,
                       pointing(site.inward)};
    };
    Motion motion;
    std::vector<StepReport> reports;
    const auto go = [&](const TipSample& tip) {
      motion.push_back(tip);
      reports.push_back(run.step(tip));
    };
    for (int i = -20; i <= 1800; ++i) run.step(at(i * 1e-5, 0));
    double deep_m = 0.018, aside_m = 0;
    go(at(deep_m, aside_m));
    for (int leg = 0; leg < 6; ++leg) {
      const bool home = leg == 5;
      const double to_m = home ? 0.018 : random.in(0.012, 0.04),
                   to_aside_m = home ? 0 : random.in(-0.01, 0.01);
      for (int i = 1; i <= 500; ++i)
        go(at(deep_m + (to_m - deep_m) * i / 500, aside_m + (to_aside_m - aside_m) * i / 500));
      deep_m = to_m;
      aside_m = to_aside_m;
    }
    EXPECT_NEAR(forceWork(motion, reports), 0, 1e-6) << seed;
  }
}

TEST(Hub, withoutItANeedleBeyondItsLengthIsOnlyFlagged) {
  SceneSpec scene = withHub(kAxial);
  scene.effects = kAxial;
  Probe probe(scene, 1000);
  probe.at(-0.001);
  probe.go(600, 0.03);
  EXPECT_NE(probe.last().flags & kFlagBeyondNeedle, 0u);
  EXPECT_EQ(hubOf(probe.last()), 0);
  EXPECT_NEAR(norm(probe.last().wrench_W.force_N), 1, 1e-9);
}

}  // namespace
}  // namespace needlelab::test
