#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>

#include "client/device/hand/simulated_device.h"
#include "client/device/pivot.h"
#include "client/device/recording/recording_device.h"
#include "tests/support/recordings/recordings.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

const Vec3 kTip{0.012, -0.008, 0.142};
constexpr double kDegree = std::numbers::pi / 180;

PivotMotion motionOf(double noise_m) {
  PivotMotion motion;
  motion.X_HT.p = kTip;
  motion.noise_m = noise_m;
  motion.encoder_step_m = 0;
  return motion;
}

// in the form the station reads
std::vector<PivotSample> samplesOf(const PivotMotion& motion, double seconds, double rate_hz) {
  PivotDevice device(motion);
  EXPECT_TRUE(device.open(rate_hz).ok());
  std::vector<PivotSample> samples;
  DeviceReading reading;
  for (double t_s = 0; t_s < seconds; t_s += 1 / rate_hz) {
    EXPECT_EQ(device.read(reading), DeviceRead::kFresh);
    samples.push_back({t_s, reading.X_WH});
  }
  return samples;
}

// Solves for the six unknowns by elimination in the full normal equations; independent of pivot.cpp.
Vec3 tipByElimination(const std::vector<PivotSample>& samples) {
  double a[6][7] = {};
  for (const PivotSample& sample : samples) {
    const Vec3 columns[3] = {rotate(sample.X_WH.q, {1, 0, 0}), rotate(sample.X_WH.q, {0, 1, 0}),
                             rotate(sample.X_WH.q, {0, 0, 1})};
    const double p[3] = {sample.X_WH.p.x, sample.X_WH.p.y, sample.X_WH.p.z};
    for (int axis = 0; axis < 3; ++axis) {
      double row[7] = {0, 0, 0, 0, 0, 0, -p[axis]};
      for (int c = 0; c < 3; ++c) row[c] = axis == 0 ? columns[c].x : axis == 1 ? columns[c].y : columns[c].z;
      row[3 + axis] = -1;
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 7; ++j) a[i][j] += row[i] * row[j];
    }
  }
  for (int i = 0; i < 6; ++i) {
    int pivot = i;
    for (int r = i + 1; r < 6; ++r)
      if (std::abs(a[r][i]) > std::abs(a[pivot][i])) pivot = r;
    std::swap_ranges(a[i], a[i] + 7, a[pivot]);
    for (int r = 0; r < 6; ++r) {
      if (r == i) continue;
      const double f = a[r][i] / a[i][i];
      for (int j = i; j < 7; ++j) a[r][j] -= f * a[i][j];
    }
  }
  return {a[0][6] / a[0][0], a[1][6] / a[1][1], a[2][6] / a[2][2]};
}

TEST(Pivot, findsTheTipExactlyWhereNothingIsWrong) {
  const PivotMotion motion = motionOf(0);
  const auto fit = fitPivot(samplesOf(motion, 12, 200));
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  EXPECT_LT(norm(fit->p_HT_m - kTip), 1e-12);
  EXPECT_LT(norm(fit->p_WP_m - motion.p_WP_m), 1e-12);
  EXPECT_LT(fit->residual_max_m, 1e-12);
  EXPECT_EQ(fit->used, fit->samples);
  EXPECT_TRUE(fit->slips.empty());
  EXPECT_EQ(pivotTrouble(*fit), "");
}

TEST(Pivot, isExactFarFromTheOriginToo) {
  PivotMotion motion = motionOf(0);
  motion.p_WP_m = {900, -700, 500};
  const auto fit = fitPivot(samplesOf(motion, 12, 200));
  ASSERT_TRUE(fit.ok());
  EXPECT_LT(norm(fit->p_HT_m - kTip), 1e-10);
}

TEST(Pivot, agreesWithTheWholeNormalEquations) {
  const auto samples = samplesOf(motionOf(1e-4), 12, 100);
  const auto fit = fitPivot(samples);
  ASSERT_TRUE(fit.ok());
  ASSERT_EQ(fit->used, samples.size());
  EXPECT_LT(norm(fit->p_HT_m - tipByElimination(samples)), 1e-11);
}

// A ring of orientations tilted by α from one axis, all around: the mean rotation is diag((1+c)/2, (1+c)/2,
// c).
TEST(Pivot, spreadOfARingIsThatOfTheFormula) {
  const double alpha = 30 * kDegree, c = std::cos(alpha);
  PivotSums sums;
  for (int i = 0; i < 360; ++i) {
    const double phi = i * kDegree, half = alpha / 2;
    sums.add({{}, {std::cos(phi) * std::sin(half), std::sin(phi) * std::sin(half), 0, std::cos(half)}});
  }
  EXPECT_NEAR(sums.spread(), 1 - (1 + c) * (1 + c) / 4, 1e-12);
}

// White noise: the estimates scatter as the covariance predicts, and each fit reports this scatter.
TEST(Pivot, scattersAccordingToItsCovariance) {
  constexpr int kRuns = 300;
  constexpr double kNoise_m = 2e-4;
  std::vector<Vec3> errors;
  double said_mm2[3] = {}, residual_square_m2 = 0, correlation = 0;
  for (int run = 0; run < kRuns; ++run) {
    PivotMotion motion = motionOf(kNoise_m);
    motion.seed = 1000 + static_cast<std::uint64_t>(run);
    const auto fit = fitPivot(samplesOf(motion, 15, 20));
    ASSERT_TRUE(fit.ok());
    errors.push_back(fit->p_HT_m - kTip);
    for (std::size_t i = 0; i < 3; ++i) said_mm2[i] += 1e6 * fit->covariance_m2[4 * i] / kRuns;
    residual_square_m2 += fit->residual_rms_m * fit->residual_rms_m / kRuns;
    correlation += fit->correlation_samples / kRuns;
  }
  double is_mm2[3] = {}, mean_mm[3] = {};
  for (const Vec3& e : errors) {
    const double mm[3] = {1e3 * e.x, 1e3 * e.y, 1e3 * e.z};
    for (int i = 0; i < 3; ++i) {
      is_mm2[i] += mm[i] * mm[i] / kRuns;
      mean_mm[i] += mm[i] / kRuns;
    }
  }
  // 300 runs give a variance to 8 % (1σ) and means to σ/√300
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(is_mm2[i] / said_mm2[i], 1, 0.3) << "coordinate " << i;
    EXPECT_LT(std::abs(mean_mm[i]), 4 * std::sqrt(is_mm2[i] / kRuns)) << "coordinate " << i;
  }
  EXPECT_NEAR(residual_square_m2, 3 * kNoise_m * kNoise_m, 0.1 * kNoise_m * kNoise_m);
  EXPECT_NEAR(correlation, 1, 0.15);
}

// Drifting noise (0.2 s memory) at 100 Hz: treated as white noise, it would predict an error four times too
// small.
TEST(Pivot, doesNotCountCorrelatedSamplesAsNews) {
  constexpr int kRuns = 100;
  const double memory = std::exp(-1 / (100 * 0.2));
  double is = 0, said = 0, white = 0;
  for (int run = 0; run < kRuns; ++run) {
    auto samples = samplesOf(motionOf(0), 24, 100);
    std::mt19937_64 random(static_cast<std::uint64_t>(run));
    std::normal_distribution<double> normal(0, 2e-4 * std::sqrt(1 - memory * memory));
    Vec3 drift;
    for (PivotSample& sample : samples) {
      drift = drift * memory + Vec3{normal(random), normal(random), normal(random)};
      sample.X_WH.p += drift;
    }
    const auto fit = fitPivot(samples);
    ASSERT_TRUE(fit.ok());
    is += normSquared(fit->p_HT_m - kTip);
    const double trace = fit->covariance_m2[0] + fit->covariance_m2[4] + fit->covariance_m2[8];
    said += trace;
    white += trace / fit->correlation_samples;
  }
  EXPECT_GT(std::sqrt(is / white), 3);
  EXPECT_GT(std::sqrt(is / said), 0.6);
  EXPECT_LT(std::sqrt(is / said), 1.5);
}

TEST(Pivot, refusesASwingInOnePlane) {
  PivotSums sums;
  std::vector<PivotSample> samples;
  for (int i = -50; i <= 50; ++i) {
    const double half = 0.5 * i * 0.6 * kDegree;
    const Quat q{std::sin(half), 0, 0, std::cos(half)};
    samples.push_back({0.1 * (i + 50), {-rotate(q, kTip), q}});
    sums.add(samples.back().X_WH);
  }
  EXPECT_LT(sums.spread(), 1e-12);
  const auto fit = fitPivot(samples);
  ASSERT_FALSE(fit.ok());
  EXPECT_THAT(fit.error().message, HasSubstr("did not turn enough"));
}

TEST(Pivot, refusesASmallSwingAndReportsTheShortfall) {
  PivotMotion motion = motionOf(30e-6);
  motion.swing_rad = 6 * kDegree;
  const auto fit = fitPivot(samplesOf(motion, 30, 100));
  ASSERT_TRUE(fit.ok());
  EXPECT_LT(fit->spread, kMinSpread);
  EXPECT_THAT(pivotTrouble(*fit), HasSubstr("swing was too small"));
  motion.swing_rad = 25 * kDegree;
  EXPECT_EQ(pivotTrouble(*fitPivot(samplesOf(motion, 30, 100))), "");
}

TEST(Pivot, leavesOutAShortSlipAndNamesIt) {
  PivotMotion motion = motionOf(30e-6);
  motion.slip_at_s = 27;
  motion.slip_m = 1.5e-3;
  const auto fit = fitPivot(samplesOf(motion, 30, 100));
  ASSERT_TRUE(fit.ok());
  EXPECT_LT(norm(fit->p_HT_m - kTip), 2e-5);
  ASSERT_EQ(fit->slips.size(), 1u);
  EXPECT_NEAR(fit->slips[0].from_s, 27, 0.02);
  EXPECT_NEAR(fit->slips[0].to_s, 30, 0.02);
  EXPECT_NEAR(fit->slips[0].distance_m, 1.5e-3, 1e-4);
  EXPECT_EQ(fit->used, 2700u);
  EXPECT_EQ(pivotTrouble(*fit), "");
}

TEST(Pivot, aTipThatSlippedForLongIsFoundAndRefused) {
  PivotMotion motion = motionOf(30e-6);
  motion.slip_at_s = 18;
  motion.slip_m = 4e-3;
  const auto fit = fitPivot(samplesOf(motion, 30, 100));
  ASSERT_TRUE(fit.ok());
  EXPECT_LT(norm(fit->p_HT_m - kTip), 5e-5);  // 40 % of the samples are wrong
  EXPECT_THAT(pivotTrouble(*fit),
              HasSubstr("out of the dimple in 40 % of the time, first from 18.0 to 30.0 s"));
}

TEST(Pivot, theApproachToTheDimpleIsIgnored) {
  auto samples = samplesOf(motionOf(30e-6), 30, 100);
  for (std::size_t i = 0; i < 300; ++i)
    samples[i].X_WH.p += Vec3{0, 0, 0.05 * (1 - static_cast<double>(i) / 300)};
  const auto fit = fitPivot(samples);
  ASSERT_TRUE(fit.ok());
  EXPECT_LT(norm(fit->p_HT_m - kTip), 2e-5);
  ASSERT_FALSE(fit->slips.empty());
  EXPECT_EQ(fit->slips[0].from_s, 0);
}

TEST(Pivot, aTipThatWandersIsRefused) {
  auto samples = samplesOf(motionOf(0), 30, 100);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0, 3e-3);
  for (PivotSample& sample : samples) sample.X_WH.p += Vec3{normal(random), normal(random), normal(random)};
  const auto fit = fitPivot(samples);
  ASSERT_TRUE(fit.ok());
  EXPECT_THAT(pivotTrouble(*fit), HasSubstr("do not fit one tip: 5."));
}

TEST(Pivot, refusesAnInvalidPose) {
  auto samples = samplesOf(motionOf(0), 1, 100);
  samples[42].X_WH.p.y = std::nan("");
  EXPECT_THAT(fitPivot(samples).error().message, HasSubstr("pose at 0.420 s"));
  samples[42].X_WH = {{}, {0, 0, 0, 0.5}};
  EXPECT_EQ(fitPivot(samples).error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(fitPivot(std::vector<PivotSample>(3)).error().message, HasSubstr("only 3 poses"));
  EXPECT_FALSE(fitPivot({}).ok());
  EXPECT_FALSE(fitPivot(std::vector<PivotSample>(100)).ok());  // at rest
}

// Free movements contain no pivot, so the fit must not find one.
TEST(Pivot, refusesMovementsThatAreNoPivot) {
  for (const test::Recordings& recordings : test::allRecordings())
    for (const std::string name : test::kPoseRecordings) {
      SCOPED_TRACE(recordings.name() + " " + name);
      const auto track = readPoseTrack(recordings.folder / "virtuose" / (name + ".csv"));
      ASSERT_TRUE(track.ok()) << track.error().message;
      std::vector<PivotSample> samples;
      for (std::size_t i = 0; i < track->t_s.size(); i += 10)
        samples.push_back({track->t_s[i], track->X_WH[i]});
      const auto fit = fitPivot(samples);
      EXPECT_TRUE(!fit.ok() || !pivotTrouble(*fit).empty());
    }
}

}  // namespace
}  // namespace needlelab
