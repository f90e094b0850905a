#include "common/scoring/attempts/reference.h"

#include <gmock/gmock.h>

#include <algorithm>
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

Comparison compared(const std::string& name, double value, const std::vector<double>& experts) {
  std::vector<std::vector<Measure>> gestures;
  for (const double v : experts) gestures.push_back(rowsOf({{name.c_str(), v}}));
  const auto bands = referenceBands(gestures);
  const auto rows = compareWithReference(rowsOf({{name.c_str(), value}}), bands);
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

TEST(Reference, fewerThanFiveExpertsGiveNoStatement) {
  for (std::size_t n = 1; n < kMinReferences; ++n) {
    std::vector<double> experts;
    for (std::size_t i = 0; i < n; ++i) experts.push_back(3 + static_cast<double>(i));
    const Comparison row = compared("peak_force_n", 9, experts);
    EXPECT_FALSE(row.place) << n;
    EXPECT_EQ(row.words, "") << n;
    EXPECT_EQ(row.n, n);
  }
  EXPECT_EQ(compared("peak_force_n", 9, {2, 3, 4, 5, 6}).place, ExpertPlace::kAbove);
}

TEST(Reference, thePlaceUsesTheExpertsMinimumAndMaximum) {
  std::mt19937_64 random(7);
  for (const MeasureKind& kind : measureKinds()) {
    if (kind.name.find('K') != std::string_view::npos) continue;
    const std::string name(kind.name);
    for (int i = 0; i < 20; ++i) {
      std::vector<double> experts(5 + static_cast<std::size_t>(i % 4));
      std::uniform_real_distribution<double> uniform(-3, 20);
      for (double& v : experts) v = uniform(random);
      const double value = uniform(random);
      const bool below = std::all_of(experts.begin(), experts.end(), [&](double v) { return value < v; });
      const bool above = std::all_of(experts.begin(), experts.end(), [&](double v) { return value > v; });
      const Comparison row = compared(name, value, experts);
      if (kind.form == MeasureForm::kYesNo) {
        EXPECT_FALSE(row.place) << name;
        continue;
      }
      ASSERT_TRUE(row.place) << name;
      EXPECT_EQ(*row.place, below   ? ExpertPlace::kBelow
                            : above ? ExpertPlace::kAbove
                                    : ExpertPlace::kWithin)
          << name;
      EXPECT_THAT(row.words, HasSubstr(std::string(placeName(*row.place)) + " the experts' range")) << name;
    }
  }
}

TEST(Reference, theWordsNameTheRangeAndNeitherDistanceNorVerdict) {
  using ::testing::Not;
  const std::vector<double> experts{2, 4, 4, 4, 5, 5, 7, 9};
  const Comparison row = compared("peak_force_n", 20, experts);
  EXPECT_EQ(row.words, "Peak force 20 N: above the experts' range, 2 N to 9 N (8 gestures)");
  for (const double value : {-20.0, 1.0, 5.0, 20.0})
    for (const char* word : {"like", "far", "better", "worse", "mean", "standard deviation", "z-score"})
      EXPECT_THAT(compared("peak_force_n", value, experts).words, Not(HasSubstr(word)));
}

TEST(Reference, aGestureTouchingAHazardOrBoneIsExcluded) {
  EXPECT_EQ(whyNoReference(rowsOf({{"hazards_touched", 0}, {"bone_contacts", 0}, {"entries", 2}})), "");
  EXPECT_EQ(whyNoReference({}), "") << "an old score may not have them";
  EXPECT_EQ(whyNoReference(rowsOf({{"hazards_touched", 1}, {"bone_contacts", 0}})), "touched 1 hazard");
  EXPECT_EQ(whyNoReference(rowsOf({{"hazards_touched", 2}, {"bone_contacts", 1}})),
            "touched 2 hazards, 1 contact with bone");
  EXPECT_EQ(whyNoReference(rowsOf({{"bone_contacts", 3}})), "3 contacts with bone");
}

TEST(Reference, layersAreNamedByTheProfile) {
  Measure row;
  row.name = "peak_force_layer_2_n";
  row.value = 6;
  row.unit = "N";
  ReferenceBand band;
  band.name = row.name;
  band.unit = "N";
  band.n = 8;
  band.least = 3;
  band.greatest = 5;
  const std::vector<std::string> layers = {"skin", "dura"};
  const auto compared = compareWithReference(std::vector{row}, std::vector{band}, layers);
  ASSERT_EQ(compared.size(), 1u);
  EXPECT_EQ(compared[0].name, "peak_force_layer_2_n");
  EXPECT_THAT(compared[0].words, HasSubstr("Peak force in dura 6 N"));
}

TEST(Reference, identicalExpertsGiveNoStatement) {
  for (const double value : {0.0, 1.0, 2.0}) {
    EXPECT_FALSE(compared("bone_contacts", value, {0, 0, 0, 0, 0}).place);
    EXPECT_FALSE(compared("target_reached", value, {1, 1, 1, 1, 1}).place);
  }
  // rounding does not count as variation
  EXPECT_FALSE(compared("peak_force_n", 5, {3, 3 + 1e-15, 3, 3 - 1e-15, 3}).place);
}

TEST(Reference, anotherExpertIsWithinAsOftenAsPredicted) {
  // (n − 1)/(n + 1) for any distribution: normal, and far from normal
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(10, 2);
  std::exponential_distribution<double> exponential(0.1);
  for (const std::size_t n : {std::size_t{5}, std::size_t{8}, std::size_t{39}}) {
    for (const bool is_normal : {true, false}) {
      const auto draw = [&] { return is_normal ? normal(random) : exponential(random); };
      int within = 0;
      constexpr int kTries = 4000;
      for (int i = 0; i < kTries; ++i) {
        std::vector<double> experts(n);
        for (double& v : experts) v = draw();
        within += compared("peak_force_n", draw(), experts).place == ExpertPlace::kWithin;
      }
      const double share = static_cast<double>(n - 1) / static_cast<double>(n + 1);
      // 4 standard errors
      EXPECT_NEAR(within / static_cast<double>(kTries), share, 4 * std::sqrt(share * (1 - share) / kTries))
          << n;
    }
  }
}

TEST(Reference, distancesAmongAreToTheNearestOther) {
  const auto at = [](double x) { return TipPath{{x, 0, 0}, {x, 0, 1}}; };
  const auto distances = distancesAmong(std::vector<TipPath>{at(0), at(1), at(4)});
  EXPECT_EQ(distances, (std::vector<double>{1, 1, 3}));
  EXPECT_TRUE(distancesAmong(std::vector<TipPath>{at(0)}).empty());
  EXPECT_EQ(distancesAmong(std::vector<TipPath>{at(0), {}, at(2)}), (std::vector<double>{2, 2}));
}

TEST(Reference, jsonHasNullForMissingStatements) {
  const auto few = nlohmann::json::parse(bandsJson(referenceBands(forces({3}))));
  EXPECT_TRUE(few[0]["sd"].is_null());
  EXPECT_TRUE(few[0]["p10"].is_null());
  const auto many = nlohmann::json::parse(bandsJson(referenceBands(forces({1, 2, 3, 4, 5}))));
  EXPECT_DOUBLE_EQ(many[0]["p10"].get<double>(), 1.4);
  const auto rows = compareWithReference(rowsOf({{"peak_force_n", 3}}), referenceBands(forces({3})));
  const auto json = nlohmann::json::parse(comparisonJson(rows));
  EXPECT_TRUE(json[0]["place"].is_null());
  EXPECT_EQ(json[0]["words"], "");
  EXPECT_EQ(json[0]["better"], "less");
  const auto placed = nlohmann::json::parse(comparisonJson(
      compareWithReference(rowsOf({{"peak_force_n", 3}}), referenceBands(forces({4, 5, 6, 7, 8})))));
  EXPECT_EQ(placed[0]["place"], "below");
  EXPECT_EQ(placed[0]["least"], 4);
  EXPECT_EQ(placed[0]["greatest"], 8);
  EXPECT_EQ(placed[0]["n"], 5);
}

}  // namespace
}  // namespace needlelab
