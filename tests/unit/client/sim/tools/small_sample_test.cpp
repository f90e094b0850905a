// Intervals and tests, checked with textbook tables.
#include "client/sim/tools/small_sample.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "client/device/hand/hand.h"

namespace needlelab {
namespace {

TEST(SmallSample, studentsTailIsThatOfTheTables) {
  struct Known {
    double t;
    std::size_t freedom;
    double tail;
  };
  constexpr Known kTable[] = {{12.7062, 1, 0.05}, {4.30265, 2, 0.05},  {3.18245, 3, 0.05},
                              {2.57058, 5, 0.05}, {2.22814, 10, 0.05}, {2.04227, 30, 0.05},
                              {63.6567, 1, 0.01}, {4.03214, 5, 0.01},  {1, 1, 0.5}};
  for (const Known& known : kTable) {
    EXPECT_NEAR(studentTail(known.t, known.freedom), known.tail, 2e-6) << known.freedom;
    EXPECT_NEAR(studentTail(-known.t, known.freedom), known.tail, 2e-6) << "both sides";
    EXPECT_NEAR(studentQuantile(known.tail, known.freedom), known.t, 1e-4 * known.t) << known.freedom;
  }
  EXPECT_EQ(studentTail(0, 7), 1);
}

TEST(SmallSample, intervalOfThreeIsTheTextbooks) {
  constexpr std::array<double, 3> kValues = {1, 2, 3};
  const MeanInterval interval = meanInterval(kValues);
  EXPECT_DOUBLE_EQ(interval.mean, 2);
  EXPECT_NEAR(interval.high - 2, 4.30265 / std::sqrt(3.0), 1e-4);
  EXPECT_NEAR(2 - interval.low, 4.30265 / std::sqrt(3.0), 1e-4);
}

TEST(SmallSample, oneValueHasNoInterval) {
  constexpr std::array<double, 1> kOne = {5};
  EXPECT_EQ(meanInterval(kOne).mean, 5);
  EXPECT_TRUE(std::isinf(meanInterval(kOne).high));
  EXPECT_EQ(meanInterval({}).count, 0u);
}

// the bounds solve (p̂ − p)² = z² p (1 − p)/n
TEST(WilsonInterval, solvesItsEquation) {
  for (const auto& [hits, count] : {std::pair{14.0, 30u}, {0.0, 30u}, {30.0, 30u}, {185.0, 200u}}) {
    const double share = hits / count;
    const ShareInterval interval = wilsonInterval(share, count);
    for (const double p : {interval.low, interval.high})
      EXPECT_NEAR((share - p) * (share - p), kNormal975 * kNormal975 * p * (1 - p) / count, 1e-15);
    EXPECT_LE(interval.low, share + 1e-12);
    EXPECT_GE(interval.high, share - 1e-12);
  }
  EXPECT_EQ(wilsonInterval(0, 0).high, 1);
}

TEST(HolmCorrected, byHand) {
  // 4 tests: 0.01·4, 0.02·3, 0.03·2 (not below the previous one), 0.5·1
  const auto corrected = holmCorrected(std::vector<double>{0.03, 0.01, 0.5, 0.02});
  const std::vector<double> expected{0.06, 0.04, 0.5, 0.06};
  ASSERT_EQ(corrected.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(corrected[i], expected[i], 1e-15) << i;
  EXPECT_EQ(holmCorrected(std::vector<double>{0.4, 0.9, 0.8}), (std::vector<double>{1, 1, 1}));
  EXPECT_EQ(holmCorrected(std::vector<double>{0.04}), std::vector<double>{0.04});
  EXPECT_TRUE(holmCorrected(std::vector<double>{}).empty());
}

// k tests without a difference: uncorrected, some p is almost always below 0.05; corrected, in 1 study of 20
TEST(HolmCorrected, keepsTheChanceOfAnyErrorAtTheLevel) {
  HandRandom random(9);
  int plain = 0, corrected = 0;
  constexpr int kStudies = 4000;
  for (int study = 0; study < kStudies; ++study) {
    std::vector<double> p(37);
    for (double& one : p) one = random.uniform();
    plain += *std::min_element(p.begin(), p.end()) <= 0.05;
    const auto all = holmCorrected(p);
    corrected += *std::min_element(all.begin(), all.end()) <= 0.05;
  }
  EXPECT_NEAR(plain / static_cast<double>(kStudies), 1 - std::pow(0.95, 37), 0.03);
  EXPECT_NEAR(corrected / static_cast<double>(kStudies), 1 - std::pow(1 - 0.05 / 37, 37), 0.015);
}

}  // namespace
}  // namespace needlelab
