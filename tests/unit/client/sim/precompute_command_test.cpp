// `needlelab-sim precompute` with whole command lines, on small meshes.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab {
namespace {

using nlohmann::json;
using test::sim;
using testing::HasSubstr;

TEST(PrecomputeCommand, writesARunnableProfileAndReportsItsErrorAgainstFem) {
  const test::TempFolder folder;
  const auto out = folder.path() / "table.json";
  const auto outcome = sim({"precompute", "--profile", (test::kSamples / "shoulder-models.json").string(),
                            "--mesh", "1000", "--rows", "101", "--out", out.string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json row = json::parse(outcome.out).at("rows").at(0);
  EXPECT_EQ(row.at("table_rows"), 101);
  EXPECT_GT(row.at("fem_peak_n"), 0.5);
  EXPECT_GE(row.at("error_max_n"), row.at("error_rms_n"));
  EXPECT_EQ(row.at("young_factor"), 1) << "its own section fem stays";

  const auto profile = loadProfile(out);
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  EXPECT_EQ(profile->axial_model(), pb::Profile::PRECOMPUTED);
  EXPECT_EQ(profile->id(), "shoulder-models-precomputed");
  ASSERT_EQ(profile->precomputed().table_size(), 101);
  EXPECT_EQ(profile->precomputed().table(0).cutting_n(), 0.0);
  EXPECT_THAT(profile->precomputed().source(),
              HasSubstr("needlelab-sim precompute of profile shoulder-models"));
  EXPECT_THAT(profile->precomputed().source(), HasSubstr("elasticity is that of the profile's section fem"));
  EXPECT_THAT(profile->precomputed().source(), HasSubstr("strained above 10 %"));
  // The table includes the shaft's friction, so it is not added a second time.
  const auto scene = sceneSpecOf(*profile);
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  EXPECT_EQ(scene->effects & bitOf(Effect::kShaftFriction), 0u);
  EXPECT_NE(scene->effects & bitOf(Effect::kAttracted), 0u);
}

TEST(PrecomputeCommand, saysWhereTheTableMissesTheWithdrawal) {
  const test::TempFolder folder;
  const auto out = folder.path() / "table.json";
  const auto outcome = sim({"precompute", "--profile", (test::kSamples / "paper-six-layers.json").string(),
                            "--mesh", "2000", "--rows", "101", "--out", out.string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json row = json::parse(outcome.out).at("rows").at(0);
  ASSERT_GT(row.at("error_out_rms_n").get<double>(), 0.175) << "what a hand notices";
  EXPECT_THAT(outcome.err, HasSubstr("misses the withdrawal by"));
  EXPECT_THAT(row.at("remark").get<std::string>(), HasSubstr("take FEM where the way out is felt"));
}

TEST(PrecomputeCommand, sameInputGivesTheSameTable) {
  const test::TempFolder folder;
  std::string text[2];
  for (const int n : {0, 1}) {
    const auto out = folder.path() / ("table" + std::to_string(n) + ".json");
    ASSERT_EQ(sim({"precompute", "--profile", (test::kSamples / "shoulder-models.json").string(), "--mesh",
                   "500", "--rows", "21", "--out", out.string()})
                  .code,
              0);
    text[n] = *readWholeFile(out);
  }
  EXPECT_EQ(text[0], text[1]);
}

// with E from the lateral stiffness alone the tip met only some 20 N/m: the table hardly rose
TEST(PrecomputeCommand, aProfileWithoutFemUsesItsWallStiffnessWithANotice) {
  const test::TempFolder folder;
  const auto out = folder.path() / "table.json";
  const auto outcome = sim({"precompute", "--profile", (test::kSamples / "paper-1dof.json").string(),
                            "--mesh", "500", "--rows", "21", "--depth", "0.02", "--out", out.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("no section fem"));
  EXPECT_THAT(outcome.out, HasSubstr("21 rows to 20.0 mm"));
  const auto profile = loadProfile(out);
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  // without friction only the tip presses: 500 N/m until it cuts at 1 N
  const auto& table = profile->precomputed().table();
  EXPECT_NEAR(table[1].cutting_n(), 500 * 0.001, 0.005);
  EXPECT_NEAR(table[5].cutting_n(), 1, 0.005);
  for (const std::string& text : {outcome.err, profile->precomputed().source()}) {
    EXPECT_THAT(text, HasSubstr("elasticity was set, not measured"));
    EXPECT_THAT(text, HasSubstr("the tip meets the walls' 500 N/m at the skin"));
  }
}

TEST(PrecomputeCommand, refusesWithFieldValueAndRangeAndWritesNothing) {
  const test::TempFolder folder;
  const auto out = folder.path() / "table.json";
  const std::string profile = (test::kSamples / "shoulder-models.json").string();
  const auto refused = [&](std::vector<std::string> more, const std::string& words) {
    std::vector<std::string> line = {"precompute", "--profile", profile, "--out", out.string()};
    line.insert(line.end(), more.begin(), more.end());
    const auto outcome = sim(line);
    EXPECT_EQ(outcome.code, 2) << words;
    EXPECT_THAT(outcome.err, HasSubstr(words));
    EXPECT_FALSE(std::filesystem::exists(out));
  };
  refused({"--mesh", "99"}, "--mesh: 99 is out of range");
  refused({"--stations", "0"}, "--stations: 0 is out of range");
  refused({"--rows", "1025"}, "--rows: 1025 is out of range");
  refused({"--depth", "2"}, "--depth in m: 2 is out of range");
  EXPECT_EQ(sim({"precompute", "--profile", profile}).code, 2);
}

TEST(PrecomputeCommand, keepsItsInput) {
  const test::TempFolder folder;
  const auto copy = folder.path() / "own.json";
  std::filesystem::copy_file(test::kSamples / "shoulder-models.json", copy);
  const auto outcome =
      sim({"precompute", "--profile", copy.string(), "--mesh", "500", "--out", copy.string()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("is the same file as the input"));
}

}  // namespace
}  // namespace needlelab
