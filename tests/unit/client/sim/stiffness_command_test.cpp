#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab::test {
namespace {

using ::testing::HasSubstr;

const std::string kPaper = NEEDLELAB_SAMPLES "/paper-1dof.json";

// paper-1dof with a membrane and shaft friction, a longer needle and no target
std::string membraneProfile(const TempFolder& folder) {
  auto profile = nlohmann::json::parse(std::ifstream(kPaper));
  profile["id"] = "membrane";
  profile["needle"]["length_m"] = 0.08;
  profile["layers"][0]["puncture"] = {{"linear_n_per_m", 900}, {"quadratic_n_per_m2", 0}, {"force_n", 0.5}};
  profile["layers"][0]["friction_n_per_m"] = 20;
  profile["shaft_friction"] = {{"stiffness_n_per_m", 100}};
  profile["effects"] = {"CUTTING", "ATTRACTED", "PUNCTURE", "SHAFT_FRICTION"};
  profile.erase("targets");
  const std::string path = (folder.path() / "membrane.json").string();
  std::ofstream(path) << profile;
  return path;
}

// b/(T (½ + D)) for b = 1.7 and 1 N·s/m, and with 0.9 more
TEST(StiffnessCommand, theLimitsAreThoseOfTheDevicesDampingAloneAndWithAGrip) {
  const Outcome run = sim({"stiffness", kPaper});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("| Virtuose, 1.7 N·s/m | 1133 | 680 | 486 | 378 | 262 |\n"));
  EXPECT_THAT(run.out, HasSubstr("| Virtuose and grip, 2.6 N·s/m | 1733 | 1040 | 743 | 578 | 400 |\n"));
  EXPECT_THAT(run.out, HasSubstr("| Falcon, 1.0 N·s/m | 667 | 400 | 286 | 222 | 154 |\n"));
  EXPECT_THAT(run.out, HasSubstr("| Falcon and grip, 1.9 N·s/m | 1267 | 760 | 543 | 422 | 292 |\n"));
}

TEST(StiffnessCommand, aProfilesRowHasWhatActsAtOnceWhoHoldsItAndTheWayToThePull) {
  const TempFolder folder;
  const Outcome run = sim({"stiffness", kPaper, membraneProfile(folder)});
  ASSERT_EQ(run.code, 0) << run.err;
  // 500 N/m: 486 are less, so 2 ticks; (1 + 0.5) N/500 N/m
  EXPECT_THAT(run.out, HasSubstr("\n| `paper-1dof` | 500 | – | – | – | – | **500** | 2, 4 | 1, 3 | 3.0 |\n"));
  // 500 + 100 N/m of tissue do not act with the membrane; 2 · 20 N/m · 40 mm/100 N/m are more than 3 mm
  EXPECT_THAT(run.out,
              HasSubstr("\n| `membrane` | 600 | 900 | – | – | – | **900** | 1, 2 | –, 1 | 16.0 |\n"));
}

TEST(StiffnessCommand, whatADeviceRefusesIsNotHeldAndAModelsDamperCountsAgainstTheDevices) {
  const TempFolder folder;
  auto profile = nlohmann::json::parse(std::ifstream(kPaper));
  const std::string path = (folder.path() / "changed.json").string();
  profile["axial_model"] = "VOIGT";
  profile["voigt"] = {{"stiffness_n_per_m", 500}, {"damping_ns_per_m", 0.5}};
  std::ofstream(path) << profile;
  // (1.7 − 0.5) N·s/m hold 800 and 480 N/m, with the grip 600 at three ticks; 0.5 hold 333, with the grip 560
  EXPECT_THAT(sim({"stiffness", path}).out, HasSubstr(" **500** | 1, 3 | –, 2 | – |\n"));
  profile["voigt"] = {{"stiffness_n_per_m", 1001}, {"damping_ns_per_m", 0}};
  std::ofstream(path) << profile;
  EXPECT_THAT(sim({"stiffness", path}).out, HasSubstr(" **1001** | –, – | –, – | – |\n"));
}

TEST(StiffnessCommand, jsonHasTheSameNumbers) {
  const TempFolder folder;
  const Outcome run = sim({"stiffness", "--json", kPaper, membraneProfile(folder)});
  ASSERT_EQ(run.code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_EQ(json["delays_ticks"], (nlohmann::json{1, 2, 3, 4, 6}));
  EXPECT_NEAR(json["limits_n_per_m"]["falcon_grip"][1].get<double>(), 1.9 / 0.0025, 1e-9);
  ASSERT_EQ(json["rows"].size(), 2u);
  const auto& row = json["rows"][1];
  EXPECT_EQ(row["profile"], "membrane");
  EXPECT_EQ(row["tissue_n_per_m"], 600);
  EXPECT_EQ(row["at_once_n_per_m"], 900);
  EXPECT_EQ(row["virtuose_grip_holds_ticks"], 2);
  EXPECT_EQ(row["falcon_holds_ticks"], nullptr);
  EXPECT_NEAR(row["pull_after_m"].get<double>(), 0.016, 1e-12);
}

TEST(StiffnessCommand, theForceModelsTablesAreItsOwn) {
  const auto page = readWholeFile(NEEDLELAB_SOURCE_DIR "/common/haptics/FORCE_MODEL.md");
  ASSERT_TRUE(page.ok());
  std::vector<std::string> command = {"stiffness"};
  for (const auto& folder : {kSamples, kSamples / "volumes"}) {
    std::set<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".json" && !entry.path().stem().string().ends_with("curriculum"))
        files.insert(entry.path().string());
    command.insert(command.end(), files.begin(), files.end());
  }
  const Outcome run = sim(command);
  ASSERT_EQ(run.code, 0) << run.err;
  std::istringstream lines(run.out);
  for (std::string line; std::getline(lines, line);)
    EXPECT_NE(page->find("\n" + line + "\n"), std::string::npos) << line;
}

TEST(StiffnessCommand, badProfilesAreNamed) {
  expectRefused("stiffness", {{{}, {"PROFILE"}},
                              {{"nowhere.json"}, {"needlelab-sim stiffness: ", "nowhere.json"}},
                              {{kPaper, NEEDLELAB_SAMPLES "/curriculum.json"}, {"curriculum.json"}}});
}

}  // namespace
}  // namespace needlelab::test
