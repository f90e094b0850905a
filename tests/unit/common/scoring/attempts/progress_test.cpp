#include "common/scoring/attempts/progress.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

namespace needlelab {
namespace {

using ::testing::HasSubstr;

TEST(Trend, byHand) {
  const auto rising = trendOf(std::vector<double>{1, 2, 4, 7});
  ASSERT_TRUE(rising);
  EXPECT_EQ(rising->tau, 1);
  EXPECT_DOUBLE_EQ(rising->slope_per_attempt, 2) << "median of 1 2 3, 3/2 5/2, 2";
  EXPECT_NEAR(rising->p, 2 / 24.0, 1e-12) << "this order or its reverse, of 4!";
  // 1 3 2 4: S = 4; orders of four with |S| ≥ 4: 1 + 3, and their reverses
  EXPECT_NEAR(trendOf(std::vector<double>{1, 3, 2, 4})->p, 8 / 24.0, 1e-12);
  EXPECT_FALSE(trendOf(std::vector<double>{1, 2, 3}));
  const auto level = trendOf(std::vector<double>{5, 5, 5, 5, 5});
  EXPECT_EQ(level->p, 1);
  EXPECT_EQ(level->slope_per_attempt, 0);
}

TEST(Trend, agreesWithAllOrdersCounted) {
  std::vector<double> order{1, 2, 3, 4, 5, 6};
  const std::vector<double> seen{2, 1, 3, 6, 4, 5};
  const double seen_tau = std::abs(trendOf(seen)->tau);
  int all = 0, as_rare = 0;
  do {
    ++all;
    as_rare += std::abs(trendOf(order)->tau) >= seen_tau - 1e-12;
  } while (std::next_permutation(order.begin(), order.end()));
  EXPECT_NEAR(trendOf(seen)->p, static_cast<double>(as_rare) / all, 1e-12);
}

TEST(Trend, chanceIsCalledATrendAtMostFiveInAHundred) {
  std::mt19937_64 random(17);
  std::normal_distribution<double> normal;
  for (const std::size_t n : {std::size_t{6}, std::size_t{12}, std::size_t{60}}) {
    int found = 0;
    for (int i = 0; i < 2000; ++i) {
      std::vector<double> values(n);
      for (double& v : values) v = normal(random);
      found += trendOf(values)->p <= 0.05;
    }
    EXPECT_LE(found / 2000.0, 0.05 + 4 * std::sqrt(0.05 * 0.95 / 2000)) << n;
  }
}

std::vector<double> curve(std::size_t n, double end, double gain, double attempts, double noise,
                          std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  for (std::size_t k = 0; k < n; ++k)
    values.push_back(end + gain * std::exp(-static_cast<double>(k) / attempts) + noise * normal(random));
  return values;
}

TEST(LearningCurve, findsTheCurveThatTheValuesWereMadeOf) {
  const auto exact = learningCurveOf(curve(12, 20, 40, 3, 0));
  ASSERT_TRUE(exact);
  EXPECT_NEAR(exact->end, 20, 1e-6);
  EXPECT_NEAR(exact->gain, 40, 1e-6);
  EXPECT_NEAR(exact->attempts, 3, 1e-6);
  EXPECT_NEAR(exact->r_squared, 1, 1e-12);
  const auto noisy = learningCurveOf(curve(20, 20, 40, 3, 1));
  ASSERT_TRUE(noisy);
  EXPECT_NEAR(noisy->end, 20, 2);
  EXPECT_NEAR(noisy->attempts, 3, 1);
}

TEST(LearningCurve, isNotFittedWhereItWouldBeAGuess) {
  std::string why;
  EXPECT_FALSE(learningCurveOf(curve(kMinForCurve - 1, 20, 40, 2, 0), &why));
  EXPECT_THAT(why, HasSubstr("needs 8 attempts"));
  std::vector<double> line;
  for (int k = 0; k < 12; ++k) line.push_back(30 - k);
  EXPECT_FALSE(learningCurveOf(line, &why)) << "a straight line has no level that it tends to";
  EXPECT_FALSE(learningCurveOf(std::vector<double>(12, 3.0), &why));
  EXPECT_THAT(why, HasSubstr("hardly differ"));
  // noise alone: significant in only a few of a hundred cases
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed)
    found += learningCurveOf(curve(12, 20, 0, 3, 1, seed)).has_value();
  EXPECT_LE(found, 45);
}

TEST(Progress, saysInWordsWhatBecameOfAMeasure) {
  std::vector<std::vector<Measure>> attempts;
  const auto times = curve(12, 20, 40, 3, 0);
  for (std::size_t k = 0; k < times.size(); ++k) {
    Measure time, smooth, lonely;
    time.name = "elapsed_s", time.unit = "s", time.value = times[k];
    smooth.name = "sparc", smooth.value = -3 + 0.1 * static_cast<double>(k);
    lonely.name = "target_distance_m", lonely.unit = "m", lonely.value = 0.001;
    attempts.push_back({smooth, time});
    if (k == 4) attempts.back().push_back(lonely);
  }
  const auto progress = progressOf(attempts);
  ASSERT_EQ(progress.size(), 3u);
  EXPECT_EQ(progress[0].name, "elapsed_s") << "in order of the table";
  EXPECT_THAT(progress[0].words, HasSubstr("it became better"));
  EXPECT_THAT(progress[0].words, HasSubstr("levels out at 20 s"));
  EXPECT_TRUE(progress[0].curve.has_value());
  EXPECT_EQ(progress[1].name, "sparc");
  EXPECT_THAT(progress[1].words, HasSubstr("rises"));
  EXPECT_THAT(progress[1].words, HasSubstr("no learning curve: a curve describes"));
  EXPECT_EQ(progress[2].attempts, std::vector<std::size_t>{4});
  EXPECT_THAT(progress[2].words, HasSubstr("too few attempts"));
  const auto json = nlohmann::json::parse(progressJson(progress));
  EXPECT_EQ(json[0]["values"].size(), 12u);
  EXPECT_TRUE(json[2]["trend"].is_null());
}

}  // namespace
}  // namespace needlelab
