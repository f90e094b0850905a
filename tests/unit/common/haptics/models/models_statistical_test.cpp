// STATISTICAL: the draws follow the section's distribution and are a function of depth.
#include "common/haptics/models/statistical.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/haptics/det_math.h"
#include "tests/support/random.h"
#include "tests/support/scenes/model_scenes.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

StatisticalSpec porcine() {
  StatisticalSpec spec;
  spec.table = {{0, 0, 0}, {0.004, 2.0, 0.5}, {0.02, 1.2, 0.6}, {0.05, 4.0, 0.4}};
  spec.seed = 7;
  return spec;
}

double meanAt(double depth_m) {
  if (depth_m < 0.004) return 2.0 * depth_m / 0.004;
  if (depth_m < 0.02) return 2.0 + (1.2 - 2.0) * (depth_m - 0.004) / 0.016;
  return std::min(4.0, 1.2 + (4.0 - 1.2) * (depth_m - 0.02) / 0.03);
}
double sdAt(double depth_m) {
  if (depth_m < 0.004) return 0.5 * depth_m / 0.004;
  if (depth_m < 0.02) return 0.5 + 0.1 * (depth_m - 0.004) / 0.016;
  return std::max(0.4, 0.6 - 0.2 * (depth_m - 0.02) / 0.03);
}

TEST(DetMath, logIsAccurate) {
  double worst = 0;
  for (double x = 1e-300; x < 1e300; x *= 1.37)
    worst = std::max(worst, std::abs(detLog(x) - std::log(x)) / std::max(1e-300, std::abs(std::log(x))));
  for (double x = 0.5; x < 2; x += 1e-4)
    if (x != 1.0) worst = std::max(worst, std::abs(detLog(x) - std::log(x)) / std::abs(std::log(x)));
  EXPECT_LT(worst, 2e-15);
  EXPECT_EQ(detLog(1.0), 0.0);
  EXPECT_EQ(detLog(0.0), -HUGE_VAL);
}

TEST(ScoreProcess, isAUnitNormalAtEveryDepthNodesOrNot) {
  const ScoreProcess process(3e-3);
  const int draws = 20'000;
  for (const double depth_m : {0.0, 1e-9, 0.00031, 0.004, 0.0171, 0.05, 0.3, 1.0, 7.0}) {
    double sum = 0, squares = 0;
    int beyond = 0;
    for (int i = 0; i < draws; ++i) {
      ScorePath path;
      const double z = process.at(scoreKey(11, static_cast<std::uint64_t>(i)), depth_m, path);
      sum += z;
      squares += z * z;
      if (std::abs(z) > 1.959964) ++beyond;
    }
    // four standard errors
    EXPECT_NEAR(sum / draws, 0.0, 4 / std::sqrt(draws)) << depth_m;
    EXPECT_NEAR(squares / draws, 1.0, 4 * std::sqrt(2.0 / draws)) << depth_m;
    EXPECT_NEAR(static_cast<double>(beyond) / draws, 0.05, 4 * std::sqrt(0.05 * 0.95 / draws)) << depth_m;
  }
}

TEST(ScoreProcess, correlationFallsWithDistanceAsTheProcessesDoes) {
  const ScoreProcess process(3e-3);
  const int draws = 20'000;
  const double from_m = 512 * process.spacing_m() / 8;
  for (const double distance_m : {2.0, 8.0, 24.0, 3.0}) {  // in nodes, so that nothing is interpolated
    const double to_m = from_m + distance_m * process.spacing_m();
    double products = 0;
    for (int i = 0; i < draws; ++i) {
      ScorePath path;
      const std::uint64_t key = scoreKey(12, static_cast<std::uint64_t>(i));
      const double a = process.at(key, from_m, path);
      products += a * process.at(key, to_m, path);
    }
    EXPECT_NEAR(products / draws, std::exp(-(to_m - from_m) / 3e-3), 4 * std::sqrt(2.0 / draws))
        << distance_m;
  }
}

TEST(ScoreProcess, theWayThereDoesNotMatterAndNothingJumps) {
  for (const double length_m : {1.0, 3e-3, 2e-5}) {
    const ScoreProcess process(length_m);
    const std::uint64_t key = scoreKey(1, 2);
    ScorePath walked, jumped;
    Random random(3);
    double before = 0;
    const double stride_m = process.spacing_m() / 16;
    for (int k = 0; k < 4000; ++k) {
      const double depth_m = k * stride_m;
      const double z = process.at(key, depth_m, walked);
      ScorePath fresh;
      ASSERT_EQ(process.at(key, depth_m, fresh), z) << k;
      process.at(key, random.in(0, 1), jumped);
      ASSERT_EQ(process.at(key, depth_m, jumped), z) << k;
      ASSERT_TRUE(k == 0 || std::abs(z - before) < 1.0) << "a sixteenth of a cell";
      before = z;
    }
  }
}

// issue 3: the 95 % band covers 93–97 % of 10,000 draws
TEST(ModelsStatistical, theBandHasItsStatedCoverage) {
  const StatisticalTarget target(porcine());
  constexpr int kDraws = 10'000;
  for (const double depth_m : {0.001, 0.004, 0.0123, 0.035, 0.06}) {
    const double m = meanAt(depth_m), s = sdAt(depth_m);
    const double sigma = std::sqrt(std::log(1 + s * s / (m * m))), mu = std::log(m) - sigma * sigma / 2;
    const double low = std::exp(mu - 1.959964 * sigma), high = std::exp(mu + 1.959964 * sigma);
    int covered = 0;
    double sum = 0, squares = 0;
    for (std::uint64_t i = 0; i < kDraws; ++i) {
      const double force = StatisticalInsertion(target, i).target_N(depth_m);
      covered += force >= low && force <= high;
      sum += force;
      squares += (force - m) * (force - m);
    }
    EXPECT_GE(covered, 0.93 * kDraws) << depth_m;
    EXPECT_LE(covered, 0.97 * kDraws) << depth_m;
    EXPECT_NEAR(sum / kDraws, m, 5 * s / std::sqrt(kDraws)) << depth_m;
    EXPECT_NEAR(std::sqrt(squares / kDraws), s, 0.06 * s) << depth_m;
  }
}

TEST(ModelsStatistical, factorsScaleMeanAndThickness) {
  StatisticalSpec spec = porcine();
  StatisticalSpec other = spec;
  other.mean_factor = 1.5;
  const StatisticalTarget plain(spec), stronger(other);
  for (const double depth_m : {0.002, 0.01, 0.04})
    EXPECT_NEAR(StatisticalInsertion(stronger, 3).target_N(depth_m),
                1.5 * StatisticalInsertion(plain, 3).target_N(depth_m), 1e-12);
  // A thicker layer moves the table's depths, so the value at 4 mm is now at 8 mm; scores depend on the true
  // depth.
  other = spec;
  other.thickness_factor = 2;
  for (auto& row : spec.table) row.sd_N = 0;
  for (auto& row : other.table) row.sd_N = 0;
  EXPECT_NEAR(StatisticalInsertion(StatisticalTarget(other), 0).target_N(0.008),
              StatisticalInsertion(StatisticalTarget(spec), 0).target_N(0.004), 1e-12);
}

// The engine renders the sampler's target, at any speed, in each insertion.
TEST(ModelsStatistical, theEngineRendersTheDrawOfItsInsertion) {
  SceneSpec scene = paperOneDof();
  scene.axial_model = AxialModel::kStatistical;
  scene.statistical = porcine();
  const StatisticalTarget target(scene.statistical);
  const Site site = defaultSite();
  for (const double speed_mps : {0.01, 0.2}) {
    EngineRun run(scene, 1000);
    for (std::uint64_t insertion = 0; insertion < 3; ++insertion) {
      StatisticalInsertion draw(target, insertion);
      int compared = 0;
      for (const TipSample& sample :
           insertHoldWithdraw(1000, site, site.inward, site.inward, 0.05, speed_mps, 0.0)) {
        const StepReport r = run.step(sample);
        if (r.phase != Phase::kInserting || r.speed_mps < 0.005) continue;
        const double expected = draw.target_N(r.depth_m);
        // The wall follows the target, except where the target rises faster than K_t.
        EXPECT_LE(-r.cutting_N, expected + 1e-9);
        if (std::abs(r.cutting_N + expected) < 1e-9) ++compared;
      }
      EXPECT_GT(compared, 100);
    }
  }
}

}  // namespace
}  // namespace needlelab::test
