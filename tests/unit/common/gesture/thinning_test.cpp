// Thinning: which values are exact, which are averaged, and that no important value is lost.
#include "common/gesture/thinning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <numbers>

namespace needlelab {
namespace {

std::vector<GestureSample> made(std::size_t count, const std::function<void(GestureSample&, double)>& fill) {
  std::vector<GestureSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i].tick = 5000 + i;
    samples[i].time_ns = static_cast<std::int64_t>(5'000'000'000 + 1'000'000 * i);
    fill(samples[i], 1e-3 * static_cast<double>(i));
  }
  return samples;
}

std::vector<GestureSample> thinned(const std::vector<GestureSample>& samples, double rate_hz,
                                   double target_hz) {
  Thinner thinner(rate_hz, target_hz);
  std::vector<GestureSample> out;
  for (const GestureSample& sample : samples) thinner.add(sample, out);
  thinner.finish(out);
  return out;
}

TEST(Thinning, keepsTheGridTheFirstAndTheLast) {
  const auto samples = made(1004, [](GestureSample&, double) {});
  const auto out = thinned(samples, 1000, 100);
  ASSERT_EQ(out.size(), 102u);
  for (std::size_t i = 0; i <= 100; ++i) {
    EXPECT_EQ(out[i].tick, 5000 + 10 * i);
    EXPECT_EQ(out[i].time_ns, samples[10 * i].time_ns);
  }
  EXPECT_EQ(out.back().tick, samples.back().tick);
  // a rate that does not divide evenly: the first sample at or after each point
  const auto odd = thinned(samples, 1000, 300);
  for (std::size_t i = 0; i + 1 < odd.size(); ++i)
    EXPECT_EQ(odd[i].tick - 5000,
              static_cast<std::uint64_t>(std::ceil(static_cast<double>(i) * 1000.0 / 300 - 1e-9)));
  EXPECT_EQ(thinned({}, 1000, 100).size(), 0u);
  EXPECT_EQ(thinned(made(1, [](GestureSample&, double) {}), 1000, 100).size(), 1u);
}

// Searching the window linearly, or moving it with each sample, would cost a grid step per sample.
TEST(Thinning, aVeryLowRateCostsHardlyMoreWorkThanAHighOne) {
  constexpr std::size_t kSamples = 200'000;
  const auto samples = made(kSamples, [](GestureSample& s, double t) { s.insertion_m = 1e-3 * t; });
  for (const double target_hz : {100.0, 0.1}) {
    Thinner thinner(1000, target_hz);
    std::vector<GestureSample> out;
    for (const GestureSample& sample : samples) thinner.add(sample, out);
    thinner.finish(out);
    EXPECT_NEAR(static_cast<double>(out.size()), 200 * target_hz, 2);
    // At either rate each sample counts in two means, and in a third where a mean begins or ends. The search
    // is binary, over a window of at most four grid steps; each window moves once per grid step.
    const double step = 1000 / target_hz;
    const double a_sample = 3 + (std::ceil(std::log2(4 * step)) + 1) * (1 + 1 / step) + 4;
    EXPECT_LE(static_cast<double>(thinner.steps()), a_sample * kSamples) << target_hz << " Hz";
    EXPECT_GE(thinner.steps(), 2 * kSamples) << "they are counted";
  }
}

TEST(Thinning, steadyMotionStaysAsItIs) {
  const auto samples = made(500, [](GestureSample& s, double t) {
    s.p_WT_m[1] = 0.3 - 0.02 * t;
    s.force_W_N[2] = 1 + 4 * t;
    s.insertion_m = 0.01 * t;
  });
  for (const GestureSample& s : thinned(samples, 1000, 50)) {
    const double t = 1e-3 * static_cast<double>(s.tick - 5000);
    EXPECT_NEAR(s.p_WT_m[1], 0.3 - 0.02 * t, 1e-14);
    EXPECT_NEAR(s.force_W_N[2], 1 + 4 * t, 1e-12);
    EXPECT_NEAR(s.insertion_m, 0.01 * t, 1e-15);
  }
}

/// The gain of a triangle of N samples each way is (sin(πfNT) / (N sin(πfT)))².
TEST(Thinning, dampsWhatTheLowerRateCannotShow) {
  using std::numbers::pi;
  for (const double hz : {3.0, 37.0, 63.0, 100.0, 163.0}) {
    const auto samples =
        made(2000, [hz](GestureSample& s, double t) { s.p_WT_m[0] = 1e-3 * std::sin(2 * pi * hz * t); });
    const double gain = std::pow(std::sin(pi * hz * 0.01) / (10 * std::sin(pi * hz * 1e-3)), 2);
    const auto out = thinned(samples, 1000, 100);
    for (std::size_t i = 1; i + 1 < out.size(); ++i) {
      const double t = 1e-3 * static_cast<double>(out[i].tick - 5000);
      EXPECT_NEAR(out[i].p_WT_m[0], gain * 1e-3 * std::sin(2 * pi * hz * t), 1e-14)
          << hz << " Hz, sample " << i;
    }
  }
}

TEST(Thinning, noFlagButtonFaultOrPeakOfTimeIsLost) {
  auto samples = made(300, [](GestureSample& s, double) { s.device_ns = 10, s.layer = 1; });
  samples[3].flags = 0x10;
  samples[4].flags = 0x8000'0000;
  samples[7].buttons = 2;
  samples[8].fault = 3;
  samples[111].device_ns = 5000;
  samples[199].engine_ns = 70;
  samples[210].layer = 2;
  const auto out = thinned(samples, 1000, 100);
  EXPECT_EQ(out[0].flags, 0u);
  EXPECT_EQ(out[1].flags, 0x8000'0010u);
  EXPECT_EQ(out[1].buttons, 2u);
  EXPECT_EQ(out[1].fault, 3);
  EXPECT_EQ(out[2].flags, 0u);
  EXPECT_EQ(out[12].device_ns, 5000);
  EXPECT_EQ(out[20].engine_ns, 70);
  EXPECT_EQ(out[21].layer, 2);
  EXPECT_EQ(out[20].layer, 1);
}

TEST(Thinning, missingTicksShiftNothingAndNonFiniteValuesDoNotSpread) {
  auto samples = made(400, [](GestureSample& s, double t) {
    s.p_WT_m[0] = 2 * t;
    // the same orientation, with either sign of the quaternion
    const double sign = static_cast<int>(t * 1000) % 3 == 0 ? -1 : 1;
    s.q_WT[0] = 0.6 * sign;
    s.q_WT[3] = 0.8 * sign;
    if (t > 0.2) s.wall_W_m[0] = 0.5;
  });
  samples[150].p_WT_m[1] = std::numeric_limits<double>::infinity();
  samples.erase(samples.begin() + 33, samples.begin() + 78);
  const auto out = thinned(samples, 1000, 100);
  ASSERT_EQ(out[4].tick, 5078u) << "the first behind the gap";
  EXPECT_EQ(out[5].tick, 5080u);
  for (const GestureSample& s : out) {
    EXPECT_NEAR(std::abs(s.q_WT[0]), 0.6, 1e-12);
    EXPECT_NEAR(s.q_WT[0] * s.q_WT[3], 0.48, 1e-12);
    const double t = 1e-3 * static_cast<double>(s.tick - 5000);
    EXPECT_EQ(std::isnan(s.wall_W_m[0]), t <= 0.2) << t;
    if (t > 0.2) {
      EXPECT_EQ(s.wall_W_m[0], 0.5);
    }
    EXPECT_EQ(std::isinf(s.p_WT_m[1]), s.tick == 5150);
  }
}

TEST(Thinning, aTargetAtTheRateOrAboveChangesNothing) {
  const auto samples =
      made(50, [](GestureSample& s, double t) { s.p_WT_m[0] = std::cos(1000 * t), s.plunger = t; });
  for (const double target : {1000.0, 4000.0}) {
    const auto out = thinned(samples, 1000, target);
    ASSERT_EQ(out.size(), samples.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
      EXPECT_EQ(out[i].p_WT_m[0], samples[i].p_WT_m[0]);
      EXPECT_EQ(out[i].plunger, samples[i].plunger);
    }
  }
}

TEST(Thinning, nonAscendingTicksRestartTheFilter) {
  auto samples = made(100, [](GestureSample&, double) {});
  const auto again = samples;
  samples.insert(samples.end(), again.begin(), again.end());
  const auto out = thinned(samples, 1000, 100);
  ASSERT_EQ(out.size(), 22u);
  EXPECT_EQ(out[10].tick, 5099u);
  EXPECT_EQ(out[11].tick, 5000u);
}

TEST(Thinning, coarserStepsKeepLosslessKinds) {
  Resolution fine;
  fine.force_N = 0;
  const Resolution coarse = coarser(fine, 10);
  EXPECT_NEAR(coarse.length_m, 1e-5, 1e-20);
  EXPECT_EQ(coarse.force_N, 0);
  fine.speed_mps = 0.01;
  EXPECT_EQ(coarser(fine, 1000).speed_mps, 1) << "no step beyond 1";
  EXPECT_TRUE(validate(coarser(fine, 1000)).ok());
}

}  // namespace
}  // namespace needlelab
