#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/csv.h"
#include "sim_run.h"
#include "support/temp_folder.h"

namespace needlelab {
namespace {

using nlohmann::json;
using test::sim;
using testing::HasSubstr;
const std::filesystem::path kSamples = NEEDLELAB_SAMPLES;

// straight down from 10 mm above the skin to `depth_m`, a second of rest, and out the same way; 40 mm/s
std::string strokeCsv(double depth_m) {
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  const double way_s = (depth_m + 0.01) / 0.04;
  for (int k = 0; k * 1e-3 <= 2 * way_s + 1; ++k) {
    const double t = k * 1e-3;
    const double down = t < way_s ? 0.04 * t : t < way_s + 1 ? 0.04 * way_s : 0.04 * (2 * way_s + 1 - t);
    appendNumber(text, t);
    text += ",0,0,";
    appendNumber(text, 0.01 - down);
    text += ",1,0,0,0\n";
  }
  return text;
}

double valueOf(const json& whole, const std::string& measure) {
  for (const auto& row : whole.at("rows"))
    if (row.at("measure") == measure) return row.at("value");
  return std::nan("");
}

TEST(ScoreCommand, measuresAStrokeThatIsKnown) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.03));
  const auto outcome = sim({"score", "--profile", (kSamples / "paper-1dof.json").string(), "--trajectory",
                            trajectory.string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json whole = json::parse(outcome.out);
  EXPECT_EQ(whole.at("version"), NEEDLELAB_VERSION);
  EXPECT_FALSE(whole.at("machine").get<std::string>().empty());
  EXPECT_NEAR(valueOf(whole, "elapsed_s"), 3, 0.002);
  EXPECT_NEAR(valueOf(whole, "path_length_m"), 0.08, 1e-3);
  EXPECT_NEAR(valueOf(whole, "time_in_tissue_s"), 1 + 2 * 0.03 / 0.04, 0.01);
  EXPECT_NEAR(valueOf(whole, "peak_force_n"), 1, 1e-6);
  EXPECT_EQ(valueOf(whole, "entries"), 1);
  EXPECT_EQ(valueOf(whole, "target_reached"), 1);
}

TEST(ScoreCommand, aTableForPeopleAndAFileForPrograms) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.02)).string();
  const auto profile = (kSamples / "paper-1dof.json").string();
  const auto table = sim({"score", "--profile", profile, "--trajectory", trajectory});
  EXPECT_EQ(table.code, 0);
  EXPECT_THAT(table.out, HasSubstr("peak_force_n"));
  const auto file = folder.path() / "score.json";
  const auto to_file =
      sim({"score", "--profile", profile, "--trajectory", trajectory, "--json", file.string()});
  EXPECT_EQ(to_file.code, 0);
  EXPECT_EQ(to_file.out, "");
  EXPECT_EQ(valueOf(json::parse(*readWholeFile(file)), "entries"), 1);
}

TEST(ScoreCommand, checksAnExercisesRequirements) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.02)).string();
  const auto profile = (kSamples / "paper-1dof.json").string();
  const auto exercise = folder.write("e.json", R"({"id": "e", "name": "Gently", "profile_id": "paper-1dof",
      "requirements": [{"measure": "peak_force_n", "max": 0.5}, {"measure": "entries", "max": 1}]})");
  const auto outcome = sim(
      {"score", "--profile", profile, "--trajectory", trajectory, "--exercise", exercise.string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  int checked = 0;
  const json whole = json::parse(outcome.out);
  for (const auto& row : whole.at("rows")) {
    if (!row.contains("passed")) continue;
    EXPECT_EQ(row.at("passed"), row.at("measure") == "entries");
    ++checked;
  }
  EXPECT_EQ(checked, 2);

  const auto wrong = folder.write("wrong.json", R"({"id": "e", "name": "Gently", "profile_id": "paper-1dof",
      "requirements": [{"measure": "elegance", "max": 1}]})");
  const auto refused =
      sim({"score", "--profile", profile, "--trajectory", trajectory, "--exercise", wrong.string()});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("elegance"));
}

TEST(ScoreCommand, aTrajectoryThatJumpsIsNoGesture) {
  const test::TempFolder folder;
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  for (int k = 0; k < 20; ++k)
    text += std::to_string(k * 1e-3) + (k < 10 ? ",0,0,0.5,1,0,0,0\n" : ",0,0,-0.01,1,0,0,0\n");
  const auto outcome = sim({"score", "--profile", (kSamples / "paper-1dof.json").string(), "--trajectory",
                            folder.write("t.csv", text).string(), "--json"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("row 16"));  // five rejected samples after the jump in row 11
  EXPECT_THAT(outcome.err, HasSubstr("jumped"));
  EXPECT_EQ(outcome.out, "");
}

TEST(ScoreCommand, refusesWrongInputAsRunDoes) {
  const test::TempFolder folder;
  const auto outcome = sim({"score", "--profile", (kSamples / "paper-1dof.json").string(), "--trajectory",
                            folder.write("t.csv", "t_s\n0\n").string()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("'px_m'"));
}

}  // namespace
}  // namespace needlelab
