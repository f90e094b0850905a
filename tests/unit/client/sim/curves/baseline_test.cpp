// The baselines through bins with known values.
#include "client/sim/curves/baseline.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

std::vector<CurveBin> binsAt(const std::vector<std::pair<double, double>>& points) {
  std::vector<CurveBin> bins;
  for (const auto& [at, value] : points) {
    bins.emplace_back();
    bins.back().at = at;
    bins.back().value = value;
  }
  return bins;
}

TEST(Baseline, dotsAreJoinedByStraightLinesAndHeldBeyondTheEnds) {
  const auto bins = binsAt({{1, 10}, {2, 20}, {4, 0}});
  const auto at = [&](double depth) { return baselineAt(Baseline::kConnectTheDots, bins, depth); };
  EXPECT_EQ(at(0), 10);
  EXPECT_EQ(at(1), 10);
  EXPECT_DOUBLE_EQ(at(1.5), 15);
  EXPECT_DOUBLE_EQ(at(3), 10);
  EXPECT_EQ(at(4), 0);
  EXPECT_EQ(at(9), 0);
}

TEST(Baseline, theLastIsHeldToTheNext) {
  const auto bins = binsAt({{1, 10}, {2, 20}, {4, 0}});
  const auto at = [&](double depth) { return baselineAt(Baseline::kHoldTheLast, bins, depth); };
  EXPECT_EQ(at(0), 10);
  EXPECT_EQ(at(1.999), 10);
  EXPECT_EQ(at(2), 20);
  EXPECT_EQ(at(3.999), 20);
  EXPECT_EQ(at(9), 0);
}

TEST(Baseline, namesAreThoseOfTheJson) {
  EXPECT_EQ(nameOf(Baseline::kConnectTheDots), "CONNECT_THE_DOTS");
  EXPECT_EQ(nameOf(Baseline::kHoldTheLast), "HOLD_THE_LAST");
}

TEST(Baseline, rebinnedValuesAreMeansOverEqualStretches) {
  std::vector<std::pair<double, double>> points;
  for (int i = 0; i < 10; ++i) points.emplace_back(i, 2 * i);
  const auto few = rebinned(binsAt(points), 3);
  // stretches of 3: 0-2, 3-5, 6-9
  ASSERT_EQ(few.size(), 3u);
  EXPECT_DOUBLE_EQ(few[0].at, 1);
  EXPECT_DOUBLE_EQ(few[0].value, 2);
  EXPECT_DOUBLE_EQ(few[1].at, 4);
  EXPECT_DOUBLE_EQ(few[2].at, 7.5);
  EXPECT_EQ(rebinned(binsAt(points), 10).size(), 10u);
  EXPECT_EQ(rebinned(binsAt(points), 1).size(), 1u);
}

}  // namespace
}  // namespace needlelab
