// The draws of the statistical model, rendered by the engine, follow the distribution of their section.
#include "client/sim/accuracy/recorded_statistical.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(StatisticalDraws, centralBandOfALogNormalForce) {
  // mean e^(1/8), sd so that µ = 0 and σ = 1/2: the band is e^(±1.96/2)
  const double mean = std::exp(0.125), sd = mean * std::sqrt(std::exp(0.25) - 1);
  const ForceBand band = centralBand95(mean, sd);
  EXPECT_NEAR(band.low_N, std::exp(-0.97998), 1e-5);
  EXPECT_NEAR(band.high_N, std::exp(0.97998), 1e-5);
}

TEST(StatisticalDraws, tenThousandKeepToTheirBandMeanSpreadAndLength) {
  constexpr std::size_t kDraws = 10'000;
  const StatisticalSpec spec = syntheticStatistics();
  const auto result = drawStatistical(spec, {0.002, 0.0075, 0.015, 0.022, 0.0265}, kDraws, 1000);
  ASSERT_TRUE(result.ok()) << result.error().message;
  ASSERT_EQ(result->depths.size(), 5u);
  for (const DrawnAtDepth& at : result->depths) {
    SCOPED_TRACE(at.depth_m);
    EXPECT_GE(at.in_band, 0.93);
    EXPECT_LE(at.in_band, 0.97);
    // four standard errors of a mean; of a log-normal's standard deviation about 5 %
    EXPECT_NEAR(at.drawn.mean_N, at.asked.mean_N, 4 * at.asked.sd_N / std::sqrt(1.0 * kDraws));
    EXPECT_NEAR(at.drawn.sd_N, at.asked.sd_N, 0.05 * at.asked.sd_N);
  }
  EXPECT_NEAR(result->correlation, std::exp(-1.0), 0.04);
  EXPECT_NEAR(result->correlation_length_m, 0.003, 0.0004);
}

TEST(StatisticalDraws, aBandOfAnotherSpreadIsLeft) {
  // Negative control: the same draws against a distribution with half the spread.
  StatisticalSpec spec = syntheticStatistics();
  const auto result = drawStatistical(spec, {0.0075}, 2000, 1000);
  ASSERT_TRUE(result.ok());
  const auto& at = result->depths[0];
  const ForceBand narrow = centralBand95(at.asked.mean_N, 0.5 * at.asked.sd_N);
  const ForceBand drawn = centralBand95(at.drawn.mean_N, at.drawn.sd_N);
  EXPECT_GT((drawn.high_N - drawn.low_N) / (narrow.high_N - narrow.low_N), 1.8);
}

TEST(BandVerdict, saysKeptMissedOrThatItCannotTell) {
  // Wilson's interval of 75 of 100: 65.7 to 82.5 %
  const BandVerdict narrow = bandVerdict(0.75, 100);
  EXPECT_NEAR(narrow.low, 0.657, 5e-4);
  EXPECT_NEAR(narrow.high, 0.825, 5e-4);
  EXPECT_EQ(narrow.text.find("MISSED: too narrow"), 0u) << narrow.text;
  EXPECT_EQ(bandVerdict(0.95, 100).text.find("kept"), 0u);
  EXPECT_EQ(bandVerdict(1, 200).text.find("MISSED: too wide"), 0u);
  EXPECT_EQ(bandVerdict(0.8, 5).text.find("cannot tell"), 0u);
  EXPECT_EQ(bandVerdict(0, 0).text.find("cannot tell"), 0u);
}

TEST(StatisticalDraws, seedsDifferAndRepeat) {
  StatisticalSpec spec = syntheticStatistics();
  const auto a = drawStatistical(spec, {0.01}, 50, 1000), again = drawStatistical(spec, {0.01}, 50, 1000);
  spec.seed += 1;
  const auto other = drawStatistical(spec, {0.01}, 50, 1000);
  ASSERT_TRUE(a.ok() && again.ok() && other.ok());
  EXPECT_EQ(a->depths[0].drawn.mean_N, again->depths[0].drawn.mean_N);
  EXPECT_NE(a->depths[0].drawn.mean_N, other->depths[0].drawn.mean_N);
}

}  // namespace
}  // namespace needlelab
