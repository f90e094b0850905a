#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "common/profile/profile.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;

std::vector<Measure> sampleScore() {
  pb::Exercise exercise;
  auto& requirement = *exercise.add_requirements();
  requirement.set_measure("peak_force_n");
  requirement.set_max(2);
  auto& unknown = *exercise.add_requirements();
  unknown.set_measure("target_distance_m");
  unknown.set_max(0.002);
  return scoreGesture(inAndOut(1000), 1000, halfSpace(), {}, &exercise);
}

TEST(ValueText, zeroHasNoSign) {
  for (const double zero : {0.0, -0.0}) EXPECT_EQ(valueText(zero, "N"), "0 N");
  EXPECT_EQ(valueText(-1e-7, "m"), "0 mm");
  EXPECT_EQ(valueText(-0.0125, "m"), "-12.5 mm");
}

TEST(ScoreJson, isAListOfRows) {
  const auto score = sampleScore();
  const auto rows = nlohmann::json::parse(scoreJson(score));
  ASSERT_EQ(rows.size(), score.size());
  for (std::size_t i = 0; i < score.size(); ++i) {
    EXPECT_EQ(rows[i]["measure"], score[i].name);
    EXPECT_EQ(rows[i]["unit"], score[i].unit);
    EXPECT_EQ(rows[i]["words"], score[i].words);
    if (score[i].measured) {
      EXPECT_EQ(rows[i]["value"].get<double>(), score[i].value) << "every bit of it";
    }
    EXPECT_EQ(rows[i].contains("passed"), score[i].passed.has_value());
    EXPECT_FALSE(rows[i].contains("min"));
  }
  const auto row =
      std::find_if(rows.begin(), rows.end(), [](const auto& r) { return r["measure"] == "peak_force_n"; });
  EXPECT_EQ((*row)["max"], 2);
  EXPECT_EQ((*row)["passed"], false);
  EXPECT_TRUE(rows.back()["value"].is_null()) << "a required target of a profile without one";
  EXPECT_EQ(nlohmann::json::parse(scoreJson({})), nlohmann::json::array());
}

TEST(VerdictName, isOneWordForPeopleEverywhere) {
  EXPECT_STREQ(verdictName(true), "passed");
  EXPECT_STREQ(verdictName(false), "not passed");
  EXPECT_STREQ(verdictName({}), "no verdict");
}

TEST(ScoreReport, alignsColumnsAndListsRequirementsFirst) {
  const auto score = sampleScore();
  std::istringstream text(scoreText(score));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), score.size() + 1) << "a line for each, and an empty one after what was required";
  EXPECT_THAT(lines[0], ::testing::StartsWith("not passed  peak_force_n"));
  EXPECT_THAT(lines[0], HasSubstr("3 N  Peak force 3 N: above the 2 N allowed"));
  EXPECT_THAT(lines[1], ::testing::StartsWith("not passed  target_distance_m"));
  EXPECT_EQ(lines[2], "");
  EXPECT_EQ(scoreText({}), "");
  // the words start in the same column
  std::size_t column = lines[0].find("Peak force 3 N");
  for (const Measure& measure : score) {
    for (const std::string& line : lines) {
      if (line.find(" " + measure.name + " ") != std::string::npos) {
        EXPECT_EQ(line.find(measure.words), column) << line;
      }
    }
  }
}

TEST(ScoreCsv, oneRowAnAttemptAndMeasure) {
  std::string text;
  appendScoreCsvHeader(text);
  const std::string json =
      R"([{"measure":"peak_force_n","value":0.1,"unit":"N","max":5.0,"passed":true,"words":"w"},)"
      R"({"measure":"entries","value":2.0,"unit":"","words":"w"},)"
      R"({"measure":"target_distance_m","value":null,"unit":"","max":0.01,"passed":false,"words":"w"}])";
  ASSERT_TRUE(
      appendScoreCsvRows(text, {"id-1", "=1+1", "a,\"b\"", 3, 1'700'000'000'123'456'789, 2}, json).ok());
  EXPECT_EQ(text,
            "session,trainee,exercise,attempt,started,definition_version,measure,value,unit,better,min,max,"
            "passed\n"
            "id-1,'=1+1,\"a,\"\"b\"\"\",3,2023-11-14T22:13:20.123Z,2,peak_force_n,0.1,N,less,,5,1\n"
            "id-1,'=1+1,\"a,\"\"b\"\"\",3,2023-11-14T22:13:20.123Z,2,entries,2,,less,,,\n"
            "id-1,'=1+1,\"a,\"\"b\"\"\",3,2023-11-14T22:13:20.123Z,2,target_distance_m,,,less,,0.01,0\n");
  const std::string before = text;
  EXPECT_FALSE(appendScoreCsvRows(text, {}, "no score").ok());
  EXPECT_EQ(text, before);
}

using ::testing::HasSubstr;

void demand(pb::Exercise& exercise, const std::string& measure, std::optional<double> min,
            std::optional<double> max) {
  auto& requirement = *exercise.add_requirements();
  requirement.set_measure(measure);
  if (min) requirement.set_min(*min);
  if (max) requirement.set_max(*max);
}

Measure scored(const std::string& measure, std::optional<double> min, std::optional<double> max) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.024}, 0.002);
  pb::Exercise exercise;
  demand(exercise, measure, min, max);
  const auto score = scoreGesture(inAndOut(1000), 1000, profile, {}, &exercise);
  const Measure* row = find(score, measure);
  EXPECT_NE(row, nullptr);
  return row == nullptr ? Measure() : *row;
}

TEST(Requirements, sayInWordsWhetherTheyAreMet) {
  Measure row = scored("peak_force_n", {}, 5);
  EXPECT_TRUE(*row.passed);
  EXPECT_EQ(*row.max, 5);
  EXPECT_FALSE(row.min.has_value());
  EXPECT_EQ(row.words, "Peak force 3 N: within the 5 N allowed");

  row = scored("peak_force_n", {}, 2.5);
  EXPECT_FALSE(*row.passed);
  EXPECT_EQ(row.words, "Peak force 3 N: above the 2.5 N allowed");

  row = scored("peak_force_n", 4, {});
  EXPECT_FALSE(*row.passed);
  EXPECT_EQ(row.words, "Peak force 3 N: below the 4 N asked for");

  row = scored("greatest_depth_m", 0.02, 0.03);
  EXPECT_TRUE(*row.passed);
  EXPECT_EQ(row.words, "Greatest depth 25 mm: within 20 mm to 30 mm");

  row = scored("target_reached", 1, {});
  EXPECT_TRUE(*row.passed);
  EXPECT_EQ(row.words, "Target reached");

  row = scored("target_reached", {}, 0);
  EXPECT_FALSE(*row.passed);

  EXPECT_EQ(scored("peak_force_n", {}, 2.9999).words, "Peak force 3 N: just above the 3 N allowed");
}

TEST(Requirements, theLimitItselfIsAllowed) {
  EXPECT_TRUE(*scored("peak_force_n", 3, 3).passed);
  EXPECT_FALSE(*scored("peak_force_n", {}, std::nextafter(3, 0)).passed);
}

TEST(Requirements, rowsWithoutOneHaveNoVerdict) {
  pb::Exercise exercise;
  demand(exercise, "entries", {}, 2);
  const auto score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {}, &exercise);
  EXPECT_FALSE(find(score, "peak_force_n")->passed.has_value());
  EXPECT_EQ(find(score, "peak_force_n")->words, "Peak force 3 N");
  EXPECT_TRUE(*find(score, "entries")->passed);
}

TEST(Requirements, theTimeLimitIsOneOnTheTimeFromTheFirstContact) {
  pb::Exercise exercise;
  exercise.set_time_limit_s(2);
  auto score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {}, &exercise);
  EXPECT_FALSE(*find(score, "needle_time_s")->passed);
  demand(exercise, "needle_time_s", {}, 10);
  score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {}, &exercise);
  EXPECT_EQ(*find(score, "needle_time_s")->max, 2) << "both hold: the stricter one counts";
  EXPECT_FALSE(*find(score, "needle_time_s")->passed);
}

TEST(Requirements, whatIsNoMeasureIsNamed) {
  pb::Exercise exercise;
  demand(exercise, "elegance", 1, {});
  const auto score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {}, &exercise);
  EXPECT_THAT(find(score, "elegance")->words, HasSubstr("is not a measure that this program knows"));
}

TEST(Requirements, namesAreCheckedBeforehand) {
  EXPECT_TRUE(isMeasureName("peak_force_n"));
  EXPECT_TRUE(isMeasureName("peak_force_layer_1_n"));
  EXPECT_TRUE(isMeasureName("peak_force_layer_32_n"));
  for (const char* name : {"", "peak_force", "peak_force_layer_0_n", "peak_force_layer_33_n",
                           "peak_force_layer__n", "peak_force_layer_01_n", "peak_force_layer_1",
                           "peak_force_layer_n", "peak_force_layer_-1_n", "peak_force_layer_1x_n"}) {
    EXPECT_FALSE(isMeasureName(name)) << name;
  }
  pb::Exercise exercise;
  demand(exercise, "entries", {}, 1);
  EXPECT_TRUE(checkRequirements(exercise).ok());
  demand(exercise, "elegance", {}, 1);
  const Status status = checkRequirements(exercise);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(status.error().message,
              HasSubstr("requirements[1].measure: \"elegance\" is not one of elapsed_s"));
}

TEST(Requirements, ofTheSampleCurriculumAreAllKnown) {
  const auto curriculum = loadCurriculum(std::filesystem::path(NEEDLELAB_SAMPLES) / "curriculum.json");
  ASSERT_TRUE(curriculum.ok()) << curriculum.error().message;
  for (const auto& exercise : curriculum->exercises()) {
    const Status status = checkRequirements(exercise);
    EXPECT_TRUE(status.ok()) << exercise.id() << ": " << status.error().message;
  }
}

}  // namespace

}  // namespace needlelab
