// The command's texts; skill/skill_study_test.cpp tests the study's numbers.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

/// The smallest study: two novices and two experts, with one attempt each at one exercise.
std::vector<std::string> smallest(const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"skill", "--trainees", "4", "--attempts", "1", "--exercises", "1"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(SkillCommand, aRowsNumbersFollowFromItsMeansAndSpreads) {
  const Outcome outcome = sim(smallest({"--json"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json.at("gestures").get<int>() - json.at("faults").get<int>(), 4);
  EXPECT_EQ(json.at("exact_test"), true);
  const auto& rows = json.at("rows");
  ASSERT_GT(rows.size(), 10u);
  std::vector<std::string> apart, differ;
  double greatest = std::numeric_limits<double>::infinity();
  for (const auto& row : rows) {
    const std::string measure = row.at("measure");
    const auto number = [&](const char* key) { return row.at(key).get<double>(); };
    const double difference = number("expert_mean") - number("novice_mean");
    const double pooled = std::hypot(number("novice_sd"), number("expert_sd")) / std::sqrt(2.0);
    if (!row.at("hedges_g").is_null() && pooled > 0) {
      // one exercise: standardised values differ from plain ones by a shift and a scale; n = 4
      EXPECT_NEAR(number("hedges_g"), difference / pooled * (1 - 3 / 7.0),
                  1e-6 * (1 + std::abs(difference / pooled)))
          << measure;
      EXPECT_LE(std::abs(number("hedges_g")), greatest) << "not in order: " << measure;
      greatest = std::abs(number("hedges_g"));
    }
    // 2, 4 or all of the 6 labellings separate four values equally far; so none can be rarer than 1 in 20
    EXPECT_NEAR(std::fmod(number("p") * 6 + 1e-9, 1), 0, 1e-8) << measure;
    EXPECT_GE(number("p"), 2 / 6.0 - 1e-12) << measure;
    EXPECT_EQ(row.at("separates"), "no") << measure;
    EXPECT_EQ(number("p_holm"), 1) << measure << ": none of so many can be below 2/6";
    apart.push_back(measure);
    EXPECT_EQ(row.at("same_at_both_rates").get<bool>(),
              number("rate_difference") <= number("rate_tolerance"));
    if (!row.at("same_at_both_rates").get<bool>()) differ.push_back(measure);
    // of 2 × 2 pairs
    EXPECT_EQ(std::fmod(number("cliffs_delta") * 4, 1), 0) << measure;
  }
  EXPECT_EQ(json.at("do_not_separate").get<std::vector<std::string>>(), apart);
  EXPECT_EQ(json.at("differ_between_rates").get<std::vector<std::string>>(), differ);
  const auto directed =
      std::count_if(rows.begin(), rows.end(), [](const auto& row) { return row.at("better") != "neither"; });
  EXPECT_EQ(json.at("finding"),
            "0 of " + std::to_string(directed) +
                " measures find 2 simulated experts better than 2 simulated novices; 0 find "
                "them worse; with labels at random any does either in 0.0 % of shuffles");
  EXPECT_EQ(json.at("separate_the_other_way").size() + json.at("separate_without_a_better_end").size(), 0u);
  EXPECT_THAT(json.at("caution").get<std::string>(), HasSubstr("no evidence about people"));
  std::vector<double> levels;
  for (const auto& hand : json.at("hands")) levels.push_back(hand.at("level"));
  EXPECT_EQ(levels, (std::vector<double>{0, 0.4, 0.6, 1}));
}

TEST(SkillCommand, withoutGnuplotTheTableIsWrittenWithANotice) {
  const TempFolder folder;
  const auto pictures = folder.path() / "new" / "folder";
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", folder.path().c_str(), 1);
  const Outcome outcome = sim(smallest({"--pictures", pictures.string()}));
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("gnuplot is not on the PATH"));
  EXPECT_FALSE(std::filesystem::exists(pictures / "skill.png"));
  // one line per measure, the last with rank 1, and the same measures for people
  std::istringstream csv(*readWholeFile(pictures / "skill.csv"));
  std::string line, last;
  ASSERT_TRUE(std::getline(csv, line));
  EXPECT_EQ(line, "place,g_to_better,low_95,high_95,separates,measure");
  int lines = 0, first_place = 0;
  while (std::getline(csv, line)) {
    if (++lines == 1) first_place = std::stoi(line);
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 5) << line;
    const std::string measure = line.substr(line.rfind(',') + 1);
    EXPECT_THAT(outcome.out, HasSubstr(measure));
    double place = 0, g = 0, low = 0, high = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf", &place, &g, &low, &high), 4) << line;
    EXPECT_LE(low, high) << line;
    // surer hands are faster: less time is better, so the effect points to the better end
    if (measure == "elapsed_s") {
      EXPECT_GT(g, 0) << line;
    }
    last = line;
  }
  EXPECT_EQ(first_place, lines);
  EXPECT_EQ(last.substr(0, 2), "1,");
}

TEST(SkillCommand, refusesWrongInputBeforeTheWork) {
  const TempFolder folder;
  const std::string below = (folder.write("file", "") / "below").string();
  const std::vector<Refused> cases = {
      {{"--trainees", "5"}, {"--trainees", "5", "even"}},
      {{"--trainees", "2"}, {"--trainees", "2", "4 to 200"}},
      {{"--trainees", "202"}, {"--trainees", "202"}},
      {{"--trainees", "-4"}, {"--trainees", "-4"}},
      {{"--attempts", "0"}, {"--attempts", "0", "1 to 100"}},
      {{"--attempts", "101"}, {"--attempts", "101"}},
      {{"--exercises", "0"}, {"--exercises", "0", "1 to 6"}},
      {{"--exercises", "7"}, {"--exercises", "7"}},
      {{"--seed", "one"}, {"--seed", "one"}},
      {{"--seed", "-1"}, {"--seed", "-1"}},
      {{"--pictures", below}, {"--pictures", below}},
      {{"--json", folder.path().string() + "/none/skill.json"}, {"none/skill.json"}},
  };
  expectRefused("skill", cases);
}

}  // namespace
}  // namespace needlelab::test
