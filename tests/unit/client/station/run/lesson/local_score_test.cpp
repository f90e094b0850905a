#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "client/station/run/lesson/local_score.h"
#include "common/scoring/anatomy/anatomy.h"
#include "tests/support/anatomy/ball_profiles.h"

namespace needlelab {
namespace {

// 1 mm per sample down from 1 m above a plane; the force is 1 N, and 5 N in sample `peak`
std::vector<GestureSample> goingDown(std::size_t count, std::size_t peak) {
  std::vector<GestureSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    GestureSample& s = samples[i];
    s.tick = i;
    s.time_ns = 5'000'000'000 + static_cast<std::int64_t>(i) * 1'000'000;
    s.p_WT_m[2] = 1 - 1e-3 * static_cast<double>(i);
    s.force_W_N[2] = i == peak ? -5 : 1;
    s.insertion_m = 1e-3 * static_cast<double>(i);
  }
  return samples;
}
const Limb kFlat = PlaneLimb{{0, 0, 0}, {0, 0, 1}};

TEST(LocalScore, theCurveKeepsEveryTickWhereThereAreFew) {
  const auto samples = goingDown(10, 3);
  const GestureCurve curve = gestureCurve(samples, kFlat, 10);
  ASSERT_EQ(curve.size(), 10u);
  EXPECT_FLOAT_EQ(curve[4].time_s, 4e-3F);
  EXPECT_FLOAT_EQ(curve[4].depth_m, -(1 - 4e-3F)) << "outside is negative";
  EXPECT_FLOAT_EQ(curve[3].force_N, 5);
}

// the path enters a ball aslant, so that its depth is less than the way along the needle
TEST(LocalScore, inABodyDepthIsAlongTheNeedleAndWithTheCapThereIsNone) {
  const Limb limb = anatomyOf(test::readProfile(test::ballOfRules()), {}).limb;
  std::vector<GestureSample> samples(3);
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i].time_ns = static_cast<std::int64_t>(i) * 1'000'000;
  samples[0].p_WT_m[2] = 0.004;
  samples[0].layer = -1;
  samples[1].p_WT_m[0] = samples[1].p_WT_m[2] = -0.005;
  samples[1].insertion_m = 0.007;
  samples[1].layer = 1;
  samples[2] = samples[1];
  samples[2].time_ns = 2'000'000;
  samples[2].flags = kFlagCapped;
  const GestureCurve curve = gestureCurve(samples, limb, 10);
  ASSERT_EQ(curve.size(), 3u);
  EXPECT_NEAR(curve[0].depth_m, -0.004, 1e-6);
  EXPECT_FLOAT_EQ(curve[1].depth_m, 0.007F);
  EXPECT_TRUE(std::isnan(curve[2].depth_m));
}

TEST(LocalScore, theCurveLosesNoPeakAndStaysShort) {
  const auto samples = goingDown(10'007, 5'003);
  const GestureCurve curve = gestureCurve(samples, kFlat, 100);
  EXPECT_LE(curve.size(), 100u);
  EXPECT_GE(curve.size(), 90u);
  int peaks = 0;
  for (std::size_t i = 0; i < curve.size(); ++i) {
    if (curve[i].force_N == 5.0F) ++peaks;
    if (i > 0) {
      EXPECT_GT(curve[i].time_s, curve[i - 1].time_s);
    }
  }
  EXPECT_EQ(peaks, 1);
}

TEST(LocalScore, theCurveHasTheDistanceFromThePlanInTissue) {
  auto samples = goingDown(10, 3);
  for (std::size_t i = 5; i < 10; ++i) samples[i].layer = 0;
  const PlannedLine plan{{0.003, 0.004, 0}, {0, 0, -1}};
  const GestureCurve curve = gestureCurve(samples, kFlat, 10, plan);
  ASSERT_EQ(curve.size(), 10u);
  for (std::size_t i = 0; i < 10; ++i) {
    if (i < 5)
      EXPECT_TRUE(std::isnan(curve[i].planned_error_m)) << "outside";
    else
      EXPECT_FLOAT_EQ(curve[i].planned_error_m, 0.005F);
  }
  for (const CurvePoint& point : gestureCurve(samples, kFlat, 10))
    EXPECT_TRUE(std::isnan(point.planned_error_m)) << "no plan";
}

TEST(LocalScore, theCurveKeepsTheGreatestDistancesOfEachGroupInTissue) {
  // of every ten ticks the first has the largest force, and the eighth the largest lateral error
  auto samples = goingDown(100, 0);
  const PlannedLine plan{{0.001, 0, 0}, {0, 0, -1}};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    GestureSample& s = samples[i];
    s.layer = i < 50 ? -1 : 0;
    s.force_W_N[2] = i % 10 == 0 ? 4 : 1;
    s.lateral_error_m = i % 10 == 7 ? 0.003 : 0.0005;
    s.p_WT_m[0] = i % 10 == 7 ? 0.006 : 0.001;
  }
  // larger lateral errors, but outside tissue or not finite
  samples[79].layer = -1;
  samples[79].lateral_error_m = 0.5;
  samples[79].p_WT_m[0] = 0.5;
  samples[89].lateral_error_m = 0.5;
  samples[89].force_W_N[0] = std::numeric_limits<double>::infinity();
  const GestureCurve curve = gestureCurve(samples, kFlat, 10, plan);
  ASSERT_EQ(curve.size(), 10u);
  for (std::size_t i = 0; i < curve.size(); ++i) {
    EXPECT_FLOAT_EQ(curve[i].force_N, 4) << i;
    EXPECT_FLOAT_EQ(curve[i].time_s, 0.01F * static_cast<float>(i)) << "of the strongest tick";
    if (i < 5) {
      EXPECT_FLOAT_EQ(curve[i].lateral_error_m, 0.0005F) << i;
      EXPECT_TRUE(std::isnan(curve[i].planned_error_m)) << i;
    } else {
      EXPECT_FLOAT_EQ(curve[i].lateral_error_m, 0.003F) << i;
      EXPECT_FLOAT_EQ(curve[i].planned_error_m, 0.005F) << i;
    }
  }
}

TEST(LocalScore, theCurveOmitsNonFiniteNumbers) {
  auto samples = goingDown(3, 0);
  samples[1].p_WT_m[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(gestureCurve(samples, kFlat).size(), 2u);
  EXPECT_TRUE(gestureCurve({}, kFlat).empty());
}

}  // namespace
}  // namespace needlelab
