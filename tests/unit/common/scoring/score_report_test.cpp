#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "common/scoring/score_csv.h"
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

TEST(ScoreText, linesUpAndPutsWhatWasRequiredFirst) {
  const auto score = sampleScore();
  std::istringstream text(scoreText(score));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), score.size() + 1) << "a line for each, and an empty one after what was required";
  EXPECT_THAT(lines[0], ::testing::StartsWith("FAIL  peak_force_n"));
  EXPECT_THAT(lines[0], HasSubstr("3 N  Peak force 3 N: above the 2 N allowed"));
  EXPECT_THAT(lines[1], ::testing::StartsWith("FAIL  target_distance_m"));
  EXPECT_EQ(lines[2], "");
  EXPECT_EQ(scoreText({}), "");
  // the words begin in one column
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
  ASSERT_TRUE(appendScoreCsvRows(text, {"id-1", "=1+1", "a,\"b\"", 3, 17, 2}, json).ok());
  EXPECT_EQ(text,
            "session,trainee,exercise,attempt,started_unix_ns,definition_version,measure,value,unit,better,"
            "min,max,passed\n"
            "id-1,'=1+1,\"a,\"\"b\"\"\",3,17,2,peak_force_n,0.10000000000000001,N,less,,5,1\n"
            "id-1,'=1+1,\"a,\"\"b\"\"\",3,17,2,entries,2,,less,,,\n"
            "id-1,'=1+1,\"a,\"\"b\"\"\",3,17,2,target_distance_m,,,less,,0.01,0\n");
  const std::string before = text;
  EXPECT_FALSE(appendScoreCsvRows(text, {}, "no score").ok());
  EXPECT_EQ(text, before);
}

}  // namespace
}  // namespace needlelab
