#include "common/scoring/reference.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

namespace needlelab {
namespace {

using ::testing::HasSubstr;

std::vector<Measure> rowsOf(std::initializer_list<std::pair<const char*, double>> values) {
  std::vector<Measure> rows;
  for (const auto& [name, value] : values) {
    Measure row;
    row.name = name;
    row.value = value;
    row.unit = measureKind(name)->unit;
    rows.push_back(row);
  }
  return rows;
}

std::vector<std::vector<Measure>> forces(const std::vector<double>& values) {
  std::vector<std::vector<Measure>> gestures;
  for (const double v : values) gestures.push_back(rowsOf({{"peak_force_n", v}}));
  return gestures;
}

Comparison compared(const std::string& name, double value, const std::vector<double>& experts,
                    std::optional<bool> passed = {}) {
  std::vector<std::vector<Measure>> gestures;
  for (const double v : experts) gestures.push_back(rowsOf({{name.c_str(), v}}));
  const auto bands = referenceBands(gestures);
  const auto rows = compareWithReference(rowsOf({{name.c_str(), value}}), bands, passed);
  EXPECT_EQ(rows.size(), 1u);
  return rows.at(0);
}

TEST(Reference, bandsByHand) {
  const auto bands = referenceBands(forces({2, 4, 4, 4, 5, 5, 7, 9}));
  ASSERT_EQ(bands.size(), 1u);
  EXPECT_EQ(bands[0].n, 8u);
  EXPECT_DOUBLE_EQ(bands[0].mean, 5);
  EXPECT_DOUBLE_EQ(bands[0].sd, std::sqrt(32 / 7.0));
  EXPECT_EQ(bands[0].least, 2);
  EXPECT_EQ(bands[0].greatest, 9);
  EXPECT_DOUBLE_EQ(bands[0].median, 4.5);
  EXPECT_DOUBLE_EQ(*bands[0].p10, 2 + 0.7 * 2);
  EXPECT_DOUBLE_EQ(*bands[0].p90, 7 + 0.3 * 2);
}

TEST(Reference, measuresThatSomeDoNotHaveAreOfFewer) {
  auto gestures = forces({1, 2, 3});
  gestures[1].push_back(rowsOf({{"target_distance_m", 0.01}})[0]);
  gestures[2].push_back(rowsOf({{"target_distance_m", 0.01}})[0]);
  gestures[2].back().measured = false;
  const auto bands = referenceBands(gestures);
  ASSERT_EQ(bands.size(), 2u);
  EXPECT_EQ(bands[0].name, "peak_force_n");
  EXPECT_EQ(bands[1].name, "target_distance_m") << "in order of the table";
  EXPECT_EQ(bands[1].n, 1u);
}

TEST(Reference, fewExpertsGiveARangeAndNoZScore) {
  for (std::size_t n = 1; n < kLeastForZScore; ++n) {
    const Comparison row = compared("peak_force_n", 9, std::vector<double>(n, 3.0));
    EXPECT_FALSE(row.z.has_value());
    EXPECT_EQ(row.standing, Standing::kTooFew);
    EXPECT_THAT(row.words, HasSubstr("too few for a comparison, which needs 5"));
    EXPECT_FALSE(row.band.p10.has_value());
  }
  EXPECT_TRUE(compared("peak_force_n", 9, {2, 3, 4, 5, 6}).z.has_value());
}

TEST(Reference, theSideThatIsBetterDependsOnTheMeasure) {
  const std::vector<double> experts{2, 4, 4, 4, 5, 5, 7, 9};
  Comparison row = compared("peak_force_n", 20, experts);
  EXPECT_DOUBLE_EQ(*row.z, 15 / std::sqrt(32 / 7.0));
  EXPECT_EQ(row.standing, Standing::kWorse);
  EXPECT_EQ(
      row.words,
      "Peak force 20 N: far from the experts, above the mean of 8 reference gestures, 5 N, worse than they "
      "are: less is better");
  EXPECT_EQ(compared("peak_force_n", -20, experts).standing, Standing::kBetter);
  EXPECT_EQ(compared("sparc", 20, experts).standing, Standing::kBetter);
  EXPECT_EQ(compared("sparc", -20, experts).standing, Standing::kWorse);
  EXPECT_EQ(compared("mean_speed_m_s", 20, experts).standing, Standing::kDifferent);
  EXPECT_EQ(compared("peak_force_n", 6, experts).standing, Standing::kLikeReference);
}

TEST(Reference, expertsCloserThanAnybodyCanTellAreTakenAsFarApartAsOneCan) {
  struct Case {
    const char* name;
    double mean, sd;  ///< the standard deviation that counts: resolution or just-noticeable difference
  };
  for (const Case& one :
       {Case{"peak_force_n", 0.5, 0.06}, Case{"peak_force_n", 4, 0.28}, Case{"mean_force_layer_2_n", 2, 0.14},
        Case{"greatest_depth_m", 0.03, 1e-3}, Case{"dtw_distance_m", 0.002, 1e-3},
        Case{"time_in_tissue_s", 2, 0.5}, Case{"elapsed_s", 30, 3}, Case{"peak_speed_m_s", 0.01, 1.5e-3},
        Case{"mean_speed_m_s", 0.1, 8e-3}, Case{"tissue_damage_m2", 1e-4, 2e-5},
        Case{"clamping_work_j", 0.01, 7e-4}, Case{"sparc", -2, 0.04}, Case{"entries", 1, 1 / std::sqrt(12)},
        Case{"injected_share", 0.5, 0.02}}) {
    for (const double spread : {0.0, 1e-3}) {  // of the sd that counts
      std::vector<double> experts;
      for (const double side : {-1, -1, 0, 1, 1}) experts.push_back(one.mean + side * spread * one.sd);
      for (const double k : {-4.0, -2.0, 0.5, 2.9, 3.2}) {
        const Comparison row = compared(one.name, one.mean + k * one.sd, experts);
        ASSERT_TRUE(row.z.has_value()) << one.name;
        EXPECT_NEAR(*row.z, k, 1e-3) << one.name;
        // for five gestures t(0.975, 4)·√(6/5) = 3.04
        EXPECT_EQ(row.standing == Standing::kLikeReference, std::abs(k) < 3.04) << one.name << ' ' << k;
      }
    }
  }
  // the band itself stays as the experts made it
  EXPECT_EQ(compared("peak_force_n", 5, {4, 4, 4, 4, 4}).band.sd, 0);
}

TEST(Reference, expertsWhoDifferKeepTheirOwnStandardDeviation) {
  const std::vector<double> experts{2, 4, 4, 4, 5, 5, 7, 9};
  for (const double value : {-3.0, 4.9, 12.5})
    EXPECT_DOUBLE_EQ(*compared("peak_force_n", value, experts).z, (value - 5) / std::sqrt(32 / 7.0));
}

TEST(Reference, everyMeasureButYesOrNoHasALeastDifference) {
  for (const MeasureKind& kind : measureKinds()) {
    const bool yes_or_no = kind.name == "target_reached" || kind.name == "aspirated_before_injection";
    const LeastDifference& least = kind.least_difference;
    EXPECT_EQ(least.absolute == 0 && least.share == 0, yes_or_no) << kind.name;
    EXPECT_GE(least.absolute, 0) << kind.name;
    EXPECT_LE(least.share, 0.10) << kind.name << ": no sense is coarser than a tenth";
  }
  EXPECT_EQ(leastDifference("no such thing", 3), 0);
  EXPECT_DOUBLE_EQ(leastDifference("peak_force_layer_3_n", -10), 0.7);
}

TEST(Reference, peopleReadFarAndNoCountOfStandardDeviations) {
  using ::testing::Not;
  std::vector<double> experts;  // 40 of them: like them is within 2.05 standard deviations
  for (int i = 0; i < 20; ++i) experts.insert(experts.end(), {8, 12});
  const double sd = std::sqrt(160 / 39.0);
  for (const double k : {-373.0, -3.1, -2.5, -1.0, 0.0, 1.0, 2.5, 3.1, 373.0}) {
    for (const char* name : {"peak_force_n", "sparc", "greatest_depth_m"}) {
      const std::string words = compared(name, 10 + k * sd, experts).words;
      EXPECT_EQ(words.find("far from the experts") != std::string::npos, std::abs(k) > 3) << words;
      EXPECT_EQ(words.find("like the experts") != std::string::npos, std::abs(k) < 2) << words;
      for (const char* jargon : {"standard deviation", "z-score", "z ="})
        EXPECT_THAT(words, Not(HasSubstr(jargon)));
    }
  }
}

TEST(Reference, nothingIsBetterInAnAttemptThatWasNotPassed) {
  using ::testing::Not;
  const std::vector<double> experts{8, 9, 10, 11, 12};
  for (const MeasureKind& kind : measureKinds()) {
    if (kind.name.find('K') != std::string_view::npos || kind.better == Better::kNeither) continue;
    const std::string name(kind.name);
    const double better = kind.better == Better::kLess ? -900 : 900;
    for (const auto passed : {std::optional<bool>(), std::optional(true)}) {
      EXPECT_EQ(compared(name, better, experts, passed).standing, Standing::kBetter) << name;
      EXPECT_THAT(compared(name, better, experts, passed).words, HasSubstr("better than they are"));
    }
    const Comparison missed = compared(name, better, experts, false);
    EXPECT_EQ(missed.standing, Standing::kDifferent) << name;
    EXPECT_THAT(missed.words, Not(HasSubstr("better")));
    EXPECT_THAT(missed.words, HasSubstr("unlike them; the attempt was not passed"));
    EXPECT_EQ(compared(name, -better, experts, false).standing, Standing::kWorse) << name;
    EXPECT_EQ(compared(name, 10, experts, false).standing, Standing::kLikeReference) << name;
  }
}

TEST(Reference, layersAreCalledByTheirNumber) {
  EXPECT_THAT(compared("peak_force_layer_12_n", 6, {2, 4, 4, 4, 5, 5, 7, 9}).words,
              HasSubstr("Peak force in layer 12 6 N"));
}

TEST(Reference, layersAreCalledByTheirNamesWhereTheProfileIsKnown) {
  Measure row;
  row.name = "peak_force_layer_2_n";
  row.value = 6;
  row.unit = "N";
  ReferenceBand band;
  band.name = row.name;
  band.n = 8;
  band.mean = 5;
  band.sd = 2;
  const std::vector<std::string> layers = {"skin", "dura"};
  const auto compared = compareWithReference(std::vector{row}, std::vector{band}, std::nullopt, layers);
  ASSERT_EQ(compared.size(), 1u);
  EXPECT_EQ(compared[0].name, "peak_force_layer_2_n");
  EXPECT_THAT(compared[0].words, HasSubstr("Peak force in dura 6 N"));
}

TEST(Reference, allExpertsAlikeHaveNoSpreadToMeasureBy) {
  Comparison row = compared("target_reached", 1, {1, 1, 1, 1, 1});
  EXPECT_FALSE(row.z.has_value());
  EXPECT_EQ(row.standing, Standing::kLikeReference);
  EXPECT_EQ(row.words, "Target reached 1: as all 5 reference gestures");
  row = compared("target_reached", 0, {1, 1, 1, 1, 1});
  EXPECT_FALSE(row.z.has_value());
  EXPECT_EQ(row.standing, Standing::kWorse);
}

TEST(Reference, oneMoreExpertIsLikeThemIn95Of100) {
  // The prediction interval has its stated coverage, even for five values: draws from one normal
  // distribution.
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(10, 2);
  for (const std::size_t n : {std::size_t{5}, std::size_t{8}, std::size_t{40}}) {
    int like = 0;
    constexpr int kTries = 4000;
    for (int i = 0; i < kTries; ++i) {
      std::vector<double> experts(n);
      for (double& v : experts) v = normal(random);
      like += compared("peak_force_n", normal(random), experts).standing == Standing::kLikeReference;
    }
    // 95 % ± 4 standard errors
    EXPECT_NEAR(like / static_cast<double>(kTries), 0.95, 4 * std::sqrt(0.95 * 0.05 / kTries)) << n;
  }
}

TEST(Reference, studentsQuantile) {
  EXPECT_NEAR(studentQuantile975(1), 12.706, 1e-3);
  EXPECT_NEAR(studentQuantile975(31), 2.0395, 0.003);
  EXPECT_NEAR(studentQuantile975(60), 2.0003, 0.003);
  EXPECT_NEAR(studentQuantile975(100000), 1.95996, 1e-4);
  for (std::size_t df = 1; df < 100; ++df)
    EXPECT_GT(studentQuantile975(df), studentQuantile975(df + 1)) << df;
}

TEST(Reference, distancesAmongAreToTheNearestOther) {
  const auto at = [](double x) { return TipPath{{x, 0, 0}, {x, 0, 1}}; };
  const auto distances = distancesAmong(std::vector<TipPath>{at(0), at(1), at(4)});
  EXPECT_EQ(distances, (std::vector<double>{1, 1, 3}));
  EXPECT_TRUE(distancesAmong(std::vector<TipPath>{at(0)}).empty());
  EXPECT_EQ(distancesAmong(std::vector<TipPath>{at(0), {}, at(2)}), (std::vector<double>{2, 2}));
}

TEST(Reference, jsonSaysNullWhereThereIsNothingToSay) {
  const auto few = nlohmann::json::parse(bandsJson(referenceBands(forces({3}))));
  EXPECT_TRUE(few[0]["sd"].is_null());
  EXPECT_TRUE(few[0]["p10"].is_null());
  const auto many = nlohmann::json::parse(bandsJson(referenceBands(forces({1, 2, 3, 4, 5}))));
  EXPECT_DOUBLE_EQ(many[0]["p10"].get<double>(), 1.4);
  const auto rows = compareWithReference(rowsOf({{"peak_force_n", 3}}), referenceBands(forces({3})), {});
  const auto json = nlohmann::json::parse(comparisonJson(rows));
  EXPECT_TRUE(json[0]["z"].is_null());
  EXPECT_EQ(json[0]["standing"], "too_few");
  EXPECT_EQ(json[0]["better"], "less");
}

}  // namespace
}  // namespace needlelab
