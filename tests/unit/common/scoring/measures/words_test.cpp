// The texts of scores: how values and limits read, why a required measure is missing. The tables in
// tests/data/scoring also apply to the console (tests/web/measures.test.mjs).
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "common/base/files/files.h"
#include "common/profile/profile.h"
#include "common/scoring/attempts/reference.h"
#include "common/scoring/measures/measure_groups.h"
#include "common/scoring/measures/measure_table.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

Json tableOf(const std::string& file) {
  const auto text = readWholeFile(NEEDLELAB_SCORING_DATA "/" + file, 1u << 20);
  EXPECT_TRUE(text.ok()) << file;
  return text.ok() ? Json::parse(*text) : Json();
}

std::optional<double> limitIn(const Json& row, const char* key) {
  return row.contains(key) ? std::optional(row[key].get<double>()) : std::nullopt;
}

TEST(Words, areThoseOfTheTable) {
  const Json table = tableOf("measure_texts.json");
  std::set<std::pair<MeasureForm, std::string_view>> seen, there;
  for (const Json& row : table["values"]) {
    const auto name = row["measure"].get<std::string>(), unit = row["unit"].get<std::string>();
    const MeasureKind* const kind = measureKind(name);
    ASSERT_NE(kind, nullptr) << name;
    EXPECT_EQ(unit, kind->unit) << name;
    EXPECT_EQ(measureText(name, row["value"], unit), row["text"]) << name;
    seen.insert({kind->form, kind->unit});
  }
  for (const MeasureKind& kind : measureKinds()) there.insert({kind.form, kind.unit});
  EXPECT_EQ(seen, there) << "each form and unit has a row";
  for (const Json& row : table["requirements"])
    EXPECT_EQ(requirementText(row["measure"].get<std::string>(), row["unit"], limitIn(row, "min"),
                              limitIn(row, "max")),
              row["text"])
        << row;
}

TEST(Words, sharesAreInPercentAndFlagsAreYesOrNo) {
  for (const MeasureKind& kind : measureKinds()) {
    EXPECT_EQ(kind.form == MeasureForm::kShare, kind.name.ends_with("_share")) << kind.name;
    if (kind.form != MeasureForm::kQuantity) EXPECT_TRUE(kind.unit.empty()) << kind.name;
  }
  EXPECT_EQ(meanText("target_reached", 0.82, ""), "82 %") << "half a yes is not a value";
  EXPECT_EQ(meanText("peak_force_n", 2.5, "N"), "2.5 N");
  EXPECT_EQ(meanText("injected_share", 0.08, ""), "8 %");
}

Measure scoredRow(const std::string& name, double value, std::optional<double> min,
                  std::optional<double> max) {
  Measure row;
  row.name = name;
  row.value = value;
  row.unit = measureKind(name)->unit;
  row.words = measureWords(name);
  pb::Exercise exercise;
  auto& requirement = *exercise.add_requirements();
  requirement.set_measure(name);
  if (min) requirement.set_min(*min);
  if (max) requirement.set_max(*max);
  std::vector<Measure> rows = {row};
  applyRequirements(&exercise, {}, {}, rows);
  return rows.at(0);
}

TEST(VerdictWords, areInTheFormOfTheMeasure) {
  EXPECT_EQ(scoredRow("injected_share", 0.5, 0.4, 0.6).words,
            "Share of the syringe injected 50 %: within 40 % to 60 %");
  EXPECT_EQ(scoredRow("injected_in_target_share", 0.799, 0.8, {}).words,
            "Share of the injection in the target 80 %: just below the 80 % asked for");
}

/// A gesture scored with a requirement on a measure that it does not have.
struct Gap {
  const char* measure;
  bool in_tissue;  ///< 15 mm deep, in muscle
  bool injects;
  bool has_target;
  const char* words;
};

TEST(MissingMeasures, areExplained) {
  const char* const never = "The needle did not go into tissue.";
  const char* const no_target = "The patient has no target.";
  for (const Gap& gap :
       {Gap{"aspirated_before_injection", true, false, true, "You did not inject."},
        Gap{"aspirated_before_injection", false, true, true, "You did not inject into tissue."},
        Gap{"injected_in_target_share", true, false, true, "You did not inject."},
        Gap{"injected_in_target_share", true, true, false, no_target},
        Gap{"target_reached", true, false, false, no_target},
        Gap{"time_at_target_s", true, false, false, no_target},
        Gap{"target_distance_m", true, false, false, no_target},
        Gap{"target_distance_m", false, false, true, never},
        Gap{"target_nearest_m", false, false, true, never},
        Gap{"path_inefficiency", false, false, true, never},
        Gap{"planned_entry_error_m", false, false, true, never},
        Gap{"planned_entry_error_m", true, false, true, "The exercise has no planned line."},
        Gap{"mean_force_layer_3_n", true, false, true, "The needle was not in bone."},
        Gap{"peak_force_layer_7_n", true, false, true, "The needle was not in layer 7."},
        Gap{"sparc", true, false, true, "The needle hardly moved."},
        Gap{"dtw_distance_m", false, false, true, never},
        Gap{"landmark_s", true, false, true, "The patient has no landmark."},
        Gap{"dtw_distance_m", true, false, true, "There is no reference gesture to compare with."}}) {
    pb::Profile profile = halfSpace();
    if (gap.has_target) addTarget(profile, {0, 0, -0.024}, 0.002);
    const auto samples = gesture(500, 4, [&](double t, GestureSample& sample) {
      setDepth(sample, gap.in_tissue ? 0.015 : -0.01);
      sample.plunger = gap.injects ? 0.2 + 0.5 * ease(t - 1, 2) : 0.2;
    });
    pb::Exercise exercise;
    auto& requirement = *exercise.add_requirements();
    requirement.set_measure(gap.measure);
    requirement.set_max(1);
    const auto score = scoreGesture(samples, 500, profile, {}, &exercise);
    const Measure* const row = find(score, gap.measure);
    ASSERT_NE(row, nullptr) << gap.measure;
    EXPECT_FALSE(row->measured) << gap.measure;
    EXPECT_FALSE(row->passed.value_or(true)) << gap.measure;
    EXPECT_EQ(row->words, gap.words) << gap.measure;
    EXPECT_EQ(row->unit, measureKind(gap.measure)->unit) << "the limit has its unit: " << gap.measure;
  }
}

TEST(MissingMeasures, haveAReasonForEveryKindWithoutIdentifiers) {
  for (const MeasureKind& kind : measureKinds()) {
    std::string name(kind.name);
    if (const std::size_t k = name.find('K'); k != std::string::npos) name.replace(k, 1, "2");
    pb::Exercise exercise;
    auto& requirement = *exercise.add_requirements();
    requirement.set_measure(name);
    requirement.set_min(1);
    std::vector<Measure> rows;
    applyRequirements(&exercise, {}, {}, rows);
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_THAT(rows[0].words, ::testing::EndsWith(".")) << name;
    EXPECT_THAT(rows[0].words, Not(HasSubstr("_"))) << name;
  }
}

TEST(SampleCourses, doNotSayWhatAStationShows) {
  // an instructor may show more or less than the exercise
  for (const char* name : {"curriculum.json", "injection-steps-curriculum.json"}) {
    const auto course = loadCurriculum(std::filesystem::path(NEEDLELAB_SAMPLES) / name);
    ASSERT_TRUE(course.ok()) << course.error().message;
    for (const auto& exercise : course->exercises())
      EXPECT_THAT(exercise.description(), Not(HasSubstr("shown"))) << exercise.id();
  }
}

TEST(Places, areThoseOfTheTable) {
  for (const Json& row : tableOf("places.json")) {
    const auto name = row["measure"].get<std::string>(), unit = row["unit"].get<std::string>();
    const auto says = row["says"].get<std::string>();
    Measure measure;
    measure.name = name;
    measure.unit = unit;
    measure.value = row["value"];
    const auto band = bandOf(name, unit, row["experts"].get<std::vector<double>>());
    const auto compared = compareWithReference(std::vector{measure}, std::vector{band});
    ASSERT_EQ(compared.size(), 1u) << says;
    EXPECT_EQ(compared[0].place.has_value(), !row["place"].is_null()) << says;
    if (compared[0].place) EXPECT_EQ(placeName(*compared[0].place), row["place"].get<std::string>()) << says;
    EXPECT_EQ(compared[0].words, row["words"]) << says;
    EXPECT_EQ(placeAmong(band, measure.value), compared[0].place) << says;
    EXPECT_EQ(expertRange(band).has_value(), compared[0].place.has_value()) << says;
    if (!compared[0].place) continue;
    const PlaceMarks marks = placeMarks(*expertRange(band), measure.value);
    EXPECT_NEAR(marks.least, row["marks"][0], 1e-8) << says;
    EXPECT_NEAR(marks.greatest, row["marks"][1], 1e-8) << says;
    EXPECT_NEAR(marks.value, row["marks"][2], 1e-8) << says;
  }
}

}  // namespace
}  // namespace needlelab
