// Intervals and tests, checked with textbook tables.
#include "client/sim/tools/small_sample.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>

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

}  // namespace
}  // namespace needlelab
