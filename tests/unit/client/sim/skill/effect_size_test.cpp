#include "client/sim/skill/effect_size.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace needlelab {
namespace {

TEST(EffectSize, cliffsDeltaByHand) {
  EXPECT_EQ(cliffsDelta(std::vector<double>{1, 2, 3}, std::vector<double>{4, 5}), 1);
  EXPECT_EQ(cliffsDelta(std::vector<double>{4, 5}, std::vector<double>{1, 2, 3}), -1);
  // 1<2 1<3 2=2 2<3: (3 − 0)/4
  EXPECT_EQ(cliffsDelta(std::vector<double>{1, 2}, std::vector<double>{2, 3}), 0.75);
}

TEST(EffectSize, hedgesGByHand) {
  // means 2 and 5, both with variance 1: d = 3, n = 6: times 1 − 3/15
  EXPECT_DOUBLE_EQ(hedgesG(std::vector<double>{1, 2, 3}, std::vector<double>{4, 5, 6}), 3 * (1 - 3 / 15.0));
  EXPECT_EQ(hedgesG(std::vector<double>{1, 1}, std::vector<double>{1, 1}), 0);
  EXPECT_EQ(hedgesG(std::vector<double>{1, 1}, std::vector<double>{2, 2}), INFINITY);
}

TEST(EffectSize, theBootstrapsIntervalHoldsTheEstimate) {
  HandRandom random(4);
  const std::vector<double> a{1, 2, 3, 4, 5, 6}, b{3, 4, 5, 6, 7, 9};
  const Interval interval = bootstrapG(a, b, 2000, random);
  EXPECT_LT(interval.low, hedgesG(a, b));
  EXPECT_GT(interval.high, hedgesG(a, b));
  EXPECT_LT(interval.high - interval.low, 6);
}

TEST(EffectSize, turnsItsSignWithTheGroupsAndBearsShiftAndScale) {
  HandRandom random(11);
  for (int round = 0; round < 50; ++round) {
    std::vector<double> a(4 + static_cast<std::size_t>(round % 3)), b(5), a_moved, b_moved;
    for (double& v : a) v = random.uniform();
    for (double& v : b) v = random.uniform();
    for (const double v : a) a_moved.push_back(3 * v - 7);
    for (const double v : b) b_moved.push_back(3 * v - 7);
    EXPECT_NEAR(hedgesG(b, a), -hedgesG(a, b), 1e-12);
    EXPECT_NEAR(hedgesG(a_moved, b_moved), hedgesG(a, b), 1e-9);
    EXPECT_EQ(cliffsDelta(b, a), -cliffsDelta(a, b));
    EXPECT_EQ(cliffsDelta(a_moved, b_moved), cliffsDelta(a, b));
    // for groups of one size Welch's t is g without its correction, times √(n/2)
    if (a.size() != b.size()) continue;
    double mean[2] = {}, square[2] = {};
    for (std::size_t i = 0; i < 5; ++i) mean[0] += a[i] / 5, mean[1] += b[i] / 5;
    for (std::size_t i = 0; i < 5; ++i)
      square[0] += std::pow(a[i] - mean[0], 2), square[1] += std::pow(b[i] - mean[1], 2);
    const double t = (mean[1] - mean[0]) / std::sqrt((square[0] / 4 + square[1] / 4) / 5);
    EXPECT_NEAR(hedgesG(a, b), t / std::sqrt(2.5) * (1 - 3 / 31.0), 1e-9);
  }
  EXPECT_EQ(hedgesG(std::vector<double>{2, 2}, std::vector<double>{1, 1}), -INFINITY);
}

TEST(EffectSize, groupsWithoutSpreadHaveAnIntervalOfOnePoint) {
  HandRandom random(4);
  const Interval apart = bootstrapG(std::vector<double>{1, 1, 1}, std::vector<double>{2, 2, 2}, 100, random);
  EXPECT_EQ(apart.low, INFINITY);
  EXPECT_EQ(apart.high, INFINITY);
  const Interval equal = bootstrapG(std::vector<double>{1, 1, 1}, std::vector<double>{1, 1, 1}, 100, random);
  EXPECT_EQ(equal.low, 0);
  EXPECT_EQ(equal.high, 0);
}

TEST(LabelTest, sampledLabellingsCountTheGivenOne) {
  // 40 values in halves: 1.4e11 ways; none of 20,000 separates them as far as the given one
  HandRandom random(4);
  std::vector<double> values(40);
  std::iota(values.begin(), values.end(), 0.0);
  const LabelTest test(values, 20, random);
  std::vector<bool> labels(40, false);
  std::fill(labels.begin(), labels.begin() + 20, true);
  EXPECT_FALSE(test.exact());
  EXPECT_DOUBLE_EQ(test.p(labels), 1 / 20'001.0);
  // every split separates at least as far as the most balanced one
  for (std::size_t i = 0; i < 40; ++i) labels[i] = i % 4 == 0 || i % 4 == 3;
  EXPECT_EQ(test.p(labels), 1);
}

TEST(LabelTest, countsAllLabellings) {
  HandRandom random(4);
  // 20 partitions; only the given one and its mirror separate them completely
  const LabelTest test({1, 2, 3, 11, 12, 13}, 3, random);
  EXPECT_TRUE(test.exact());
  EXPECT_DOUBLE_EQ(test.p({true, true, true, false, false, false}), 2 / 20.0);
  EXPECT_DOUBLE_EQ(test.p({false, false, false, true, true, true}), 2 / 20.0);
  // the second best: 1 2 4 and 3 5 6
  EXPECT_DOUBLE_EQ(test.p({true, true, false, true, false, false}), 4 / 20.0);
  const LabelTest same({5, 5, 5, 5}, 2, random);
  EXPECT_EQ(same.p({true, true, false, false}), 1);
}

TEST(LabelTest, chanceSeparatesInFiveOfAHundredAtMost) {
  HandRandom random(9);
  for (const std::size_t n : {std::size_t{8}, std::size_t{12}, std::size_t{40}}) {
    std::vector<double> values(n);
    for (double& v : values) v = std::floor(20 * random.uniform());  // with ties
    const LabelTest test(values, n / 2, random);
    EXPECT_EQ(test.exact(), n < 40);
    int found = 0;
    constexpr int kShuffles = 4000;
    for (int i = 0; i < kShuffles; ++i) found += test.p(randomLabels(n, n / 2, random)) <= 0.05;
    EXPECT_LE(found / static_cast<double>(kShuffles), 0.05 + 4 * std::sqrt(0.05 * 0.95 / kShuffles)) << n;
  }
}

TEST(LabelTest, labelsAreDrawnEvenly) {
  HandRandom random(2);
  std::vector<int> first(6, 0);
  for (int i = 0; i < 6000; ++i) {
    const auto labels = randomLabels(6, 2, random);
    EXPECT_EQ(std::count(labels.begin(), labels.end(), true), 2);
    for (std::size_t k = 0; k < 6; ++k) first[k] += labels[k];
  }
  for (const int count : first) EXPECT_NEAR(count, 2000, 4 * std::sqrt(6000 * 2 / 9.0));
}

}  // namespace
}  // namespace needlelab
