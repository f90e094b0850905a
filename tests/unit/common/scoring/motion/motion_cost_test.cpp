#include "common/scoring/motion/motion_cost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/track.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

/// Pieces of `each` samples one tick apart, with `apart` ticks between pieces.
std::vector<GestureSample> inPieces(std::size_t pieces, std::size_t each, std::uint64_t apart) {
  std::vector<GestureSample> samples;
  std::uint64_t tick = 0;
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    for (std::size_t i = 0; i < each; ++i) {
      GestureSample sample;
      setDown(sample);
      sample.tick = tick + i;
      setTip(sample, {1e-6 * static_cast<double>(samples.size()), 0, 0});
      samples.push_back(sample);
    }
    tick += each - 1 + apart;
  }
  return samples;
}

MotionCost costOf(const std::vector<GestureSample>& samples, double rate_hz) {
  return motionCost(RecordedSamples(samples), rate_hz);
}

std::uint64_t reachOf(double period_s) {
  return static_cast<std::uint64_t>(
      std::ceil(4 * std::sqrt(std::log(2)) / (2 * std::numbers::pi * 6) / period_s));
}

TEST(MotionCost, countsThePointsThatARunWillHave) {
  for (const double rate_hz : {50.0, 1000.0, 40'000.0}) {
    for (const std::size_t each : {1u, 2u, 3u, 50u}) {
      const auto samples = inPieces(5, each, static_cast<std::uint64_t>(0.2 * rate_hz));
      std::uint64_t points = 0, terms = 0;
      for (const needlelab::Run& run : runsOf(samples, rate_hz)) {
        points += run.points.size();
        if (run.points.size() > 1) terms += run.points.size() * reachOf(run.period_s);
      }
      const MotionCost cost = costOf(samples, rate_hz);
      EXPECT_EQ(cost.points, points) << rate_hz << " Hz, " << each;
      EXPECT_EQ(cost.terms, terms) << rate_hz << " Hz, " << each;
    }
  }
  EXPECT_EQ(costOf({}, 1000).points, 0u);
}

TEST(MotionCost, theLongestHonestSessionIsScoredTwiceOver) {
  // an hour at 1 kHz, one sample per 10 ticks: as many points as with all samples
  const auto hour = inPieces(359'999, 1, 10);
  EXPECT_EQ(costOf(hour, 1000).points, 359'999u);
  EXPECT_TRUE(checkMotion(RecordedSamples(hour), 1000).ok());
}

TEST(MotionCost, sparseSamplesAreRefusedBeforeAllocation) {
  // 50 Hz and one sample per 5 ticks, as close to the longest bridge as possible: 10 points per sample
  const std::size_t samples = 36'002;
  const auto spread = inPieces(samples, 1, 5);
  EXPECT_EQ(costOf(spread, 50).points, 10 * (samples - 1) + 1);
  const Status refused = checkMotion(RecordedSamples(spread), 50);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, HasSubstr("360011 points at 100 Hz, at most 360000"));
  EXPECT_TRUE(scoreGesture(spread, 50, {}, {}).empty());
  EXPECT_TRUE(tipPathOf(spread, 50, {}).empty());
  EXPECT_TRUE(checkMotion(RecordedSamples(inPieces(36'000, 1, 5)), 50).ok());
}

TEST(MotionCost, manyShortPiecesOfAHighRateAreRefused) {
  // pairs one tick apart at 40 kHz, with 5,000 ticks between: each needs a kernel of 3,534 points on each
  // side
  const std::uint64_t reach = reachOf(1.0 / 40'000);
  const std::uint64_t most = kMaxSmoothingTerms / (2 * reach);
  const auto allowed = inPieces(most, 2, 5000), refused = inPieces(most + 1, 2, 5000);
  EXPECT_EQ(costOf(allowed, 40'000).terms, most * 2 * reach);
  EXPECT_TRUE(checkMotion(RecordedSamples(allowed), 40'000).ok());
  const Status no = checkMotion(RecordedSamples(refused), 40'000);
  ASSERT_FALSE(no.ok());
  EXPECT_THAT(no.error().message, HasSubstr("at most 7200000"));
  EXPECT_TRUE(scoreGesture(refused, 40'000, {}, {}).empty());
}

TEST(MotionCost, aStationThatLosesTicksAtOneKilohertzIsScored) {
  // half an hour of pairs between gaps of 0.101 s
  EXPECT_TRUE(checkMotion(RecordedSamples(inPieces(18'000, 2, 101)), 1000).ok());
}

}  // namespace
}  // namespace needlelab
