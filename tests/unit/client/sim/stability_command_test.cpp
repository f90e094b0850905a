#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/sim/stability/case_file.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab {
namespace {

using nlohmann::json;
using test::Outcome;
using test::sim;
using testing::HasSubstr;

json jsonFrom(const std::filesystem::path& file) {
  const auto text = readWholeFile(file);
  return text.ok() ? json::parse(*text) : json();
}

TEST(StabilityCommand, givesTheRowsOfTheContract) {
  const test::TempFolder folder;
  const auto file = folder.path() / "rows.json";
  const Outcome run = sim({"stability", "--case", "boundary_hold", "--model", "ENHANCED_TRACKING_WALL",
                           "--model", "DIRECT", "--json", file.string()});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("boundary_hold"));
  const json whole = jsonFrom(file);
  ASSERT_TRUE(whole.contains("version") && whole.contains("machine"));
  ASSERT_EQ(whole.at("rows").size(), 2U);
  const json &wall = whole["rows"][0], &direct = whole["rows"][1];
  EXPECT_EQ(wall.at("case"), "boundary_hold");
  EXPECT_EQ(wall.at("model"), "ENHANCED_TRACKING_WALL");
  EXPECT_EQ(wall.at("applicable"), true);
  EXPECT_EQ(wall.at("finite"), true);
  EXPECT_EQ(wall.at("verdict"), "stable");
  EXPECT_EQ(wall.at("passed"), true);
  EXPECT_LE(wall.at("measured"), wall.at("limit"));
  EXPECT_LE(wall.at("max_unexplained_step_n"), 0.05);
  EXPECT_LT(wall.at("energy_j"), 0) << "the hand pays for the insertion";
  EXPECT_GT(wall.at("max_force_n"), 1);
  // 3.5 and 0.5 N·s/m over T (½ + 1) and 500 N/m: stable with this hand, not passive without it
  EXPECT_NEAR(wall.at("coupled_margin").get<double>(), 3.5 / 1.5e-3 / 500, 1e-9);
  EXPECT_NEAR(wall.at("passive_margin").get<double>(), 0.5 / 1.5e-3 / 500, 1e-9);
  EXPECT_EQ(wall.at("step_noticeable"), false);
  EXPECT_TRUE(wall.at("grip_energy_j").is_number());
  EXPECT_THAT(run.out, HasSubstr("boundary_hold           4.67           0.667 not"));
  EXPECT_EQ(direct.at("verdict"), "chatters");
  EXPECT_EQ(direct.at("passed"), false);
  EXPECT_GT(direct.at("chatter_n"), wall.at("chatter_n"));
}

TEST(StabilityCommand, aModelWithoutAStatementInACaseIsMarked) {
  const Outcome run = sim({"stability", "--case", "creep_then_stop", "--model", "DIRECT", "--json"});
  ASSERT_EQ(run.code, 0) << run.err;
  const json row = json::parse(run.out).at("rows").at(0);
  EXPECT_EQ(row.at("applicable"), false);
  for (const char* field : {"finite", "measured", "limit", "passed", "verdict"})
    EXPECT_TRUE(row.at(field).is_null()) << field;
  EXPECT_THAT(sim({"stability", "--case", "creep_then_stop", "--model", "DIRECT"}).out,
              HasSubstr("\nNothing was judged: these cases say nothing about these models.\n"));
}

TEST(StabilityCommand, aWallThatIsNotStableIsAFailure) {
  const test::TempFolder folder;
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok());
  json changed = file->json();
  changed["cases"]["hold_quantised"]["limit"] = 0.001;
  const auto cases = folder.write("cases.json", changed.dump());
  const Outcome run = sim({"stability", "--cases", cases.string(), "--case", "hold_quantised", "--model",
                           "ENHANCED_TRACKING_WALL"});
  EXPECT_EQ(run.code, 1);
  EXPECT_THAT(run.err, HasSubstr("the enhanced tracking wall is not stable in hold_quantised"));
}

TEST(StabilityCommand, wrongInputIsNamed) {
  const test::TempFolder folder;
  const Outcome no_case = sim({"stability", "--case", "hold_fast"});
  EXPECT_EQ(no_case.code, 2);
  EXPECT_THAT(no_case.err, HasSubstr("--case: there is no 'hold_fast'; there are hold_quantised, "));
  const Outcome no_model = sim({"stability", "--model", "WALL"});
  EXPECT_EQ(no_model.code, 2);
  EXPECT_THAT(no_model.err, HasSubstr("--model: there is no 'WALL'; there are ENHANCED_TRACKING_WALL, "));
  const auto broken = folder.write("cases.json", R"({"version": 1})");
  const Outcome wrong = sim({"stability", "--cases", broken.string()});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("cases.json: plant: must be an object"));
  const Outcome none = sim({"stability", "--cases", (folder.path() / "none.json").string()});
  EXPECT_NE(none.code, 0);
  EXPECT_THAT(none.err, HasSubstr("none.json"));
}

TEST(StabilityCommand, drawsTheCasesThatItRan) {
  if (!hasGnuplot()) GTEST_SKIP() << "gnuplot is not on the PATH";
  const test::TempFolder folder;
  const Outcome run = sim({"stability", "--case", "boundary_hold", "--model", "ENHANCED_TRACKING_WALL",
                           "--model", "DIRECT", "--out", (folder.path() / "out").string()});
  ASSERT_EQ(run.code, 0) << run.err;
  for (const char* name : {"stability.png", "stability-holds.png"})
    EXPECT_GT(std::filesystem::file_size(folder.path() / "out" / name), 5000U) << name;
}

// the case with trouble first, by its title, with its control; cells that are all equal are grey (4)
TEST(StabilityCommand, thePictureHasTheMostTroubledCaseOnTop) {
  if (!hasGnuplot()) GTEST_SKIP() << "gnuplot is not on the PATH";
  const test::TempFolder folder;
  auto changed = CaseFile::embedded().value().json();
  changed["cases"]["loose_tap"]["neighbours"] = {
      {"count", 2}, {"spread", 0.1}, {"least_stable", 1}, {"seed", 1}};
  changed["cases"]["loose_tap"]["hold_limit_n"] = 0;
  const auto cases = folder.write("cases.json", changed.dump());
  sim({"stability", "--case", "quaternion_sign", "--case", "loose_tap", "--model", "ENHANCED_TRACKING_WALL",
       "--cases", cases.string(), "--out", (folder.path() / "out").string()});
  const std::string text = readWholeFile(folder.path() / "out" / "stability.dat").value();
  EXPECT_LT(text.find("on bone, taps 4 ticks late\t"), text.find("the quaternion’s sign alternates\t"));
  EXPECT_THAT(text, HasSubstr("neighbours that stay stable ≥ 100 % · with control"));
  EXPECT_THAT(text, HasSubstr("0\t1\t4\t0\n")) << "stable, as in all";
  EXPECT_THAT(text, testing::Not(HasSubstr("quaternion_sign")));
}

std::string deviceFile(const char* name) {
  return std::string(NEEDLELAB_SOURCE_DIR) + "/tests/stability/devices/" + name + ".json";
}

// A device that is told more damping and renders earlier holds stiffer scenes; and each patient has a cell.
TEST(StabilityCommand, anOwnDeviceIsJudgedInEachPatient) {
  const test::TempFolder folder;
  auto few = CaseFile::embedded().value().json();
  few["cases"]["late_rest"]["neighbours"] = {{"count", 2}, {"spread", 0.1}, {"least_stable", 1}, {"seed", 1}};
  const auto cases = folder.write("cases.json", few.dump()).string();
  double safe_N_per_m[2] = {};
  for (const int i : {0, 1}) {
    const Outcome run = sim(
        {"stability", "--cases", cases, "--device", deviceFile(i == 0 ? "falcon" : "virtuose"), "--json"});
    ASSERT_EQ(run.code, 0) << run.err;
    std::size_t patients = 0;
    const json whole = json::parse(run.out);
    for (const json& row : whole.at("rows")) {
      EXPECT_EQ(row.at("neighbours"), 2);
      if (row.at("scene") != "one_layer")
        ++patients;
      else if (row.at("passed") == true)
        safe_N_per_m[i] = row.at("at_once_n_per_m");
    }
    EXPECT_GE(patients, 10u);
  }
  EXPECT_GT(safe_N_per_m[0], 200);
  EXPECT_GT(safe_N_per_m[1], 1.25 * safe_N_per_m[0]);
}

TEST(StabilityCommand, whatIsWrongWithADeviceIsNamed) {
  const test::TempFolder folder;
  auto device = jsonFrom(deviceFile("falcon"));
  device["told"].erase("lag_s");
  const Outcome untold = sim({"stability", "--device", folder.write("a.json", device.dump()).string()});
  EXPECT_EQ(untold.code, 2);
  EXPECT_THAT(untold.err, HasSubstr("a.json: told.lag_s: must be a number"));
  device = jsonFrom(deviceFile("falcon"));
  device["mass"] = 1;
  const Outcome unknown = sim({"stability", "--device", folder.write("b.json", device.dump()).string()});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("b.json: cases.late_rest.plant.mass: unknown"));
}

}  // namespace
}  // namespace needlelab
