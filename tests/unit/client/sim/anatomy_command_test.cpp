/// `needlelab-sim anatomy`: rows against a fine march, the same for a seed; a picture.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "client/sim/anatomy/anatomy_study.h"
#include "client/sim/tools/gnuplot.h"
#include "common/profile/profile.h"
#include "common/profile/volume.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

const std::filesystem::path kForearm =
    std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "client/sim/anatomy/forearm.json";

const AnatomyRow& rowOf(const AnatomyReport& report, const AnatomyMethod& method) {
  for (const AnatomyRow& row : report.rows)
    if (row.method == method) return row;
  throw std::runtime_error("no such row");
}

TEST(AnatomyStudy, aStepOfATenthOfAMillimetreIsWithinTheGoal) {
  const auto profile = loadProfile(kForearm);
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const auto report = anatomyStudy(*profile, {.paths = 60, .seed = 3}, [](double) {});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->paths, 60u);
  EXPECT_GT(report->layers_per_path, 4);
  const AnatomyRow& product = rowOf(*report, {AnatomySteps::kSphere, 0.1e-3});
  EXPECT_LE(product.force_rms_N, 0.02);
  EXPECT_LE(product.boundary_p99_mm, 2 * 1e3 * kBoundary_m);
  EXPECT_GT(product.force_rms_N + rowOf(*report, {AnatomySteps::kFixed, 2e-3}).force_rms_N, 0)
      << "a study that sees no error sees nothing";
  EXPECT_GT(rowOf(*report, {AnatomySteps::kFixed, 2e-3}).missed_percent,
            rowOf(*report, {AnatomySteps::kFixed, 0.1e-3}).missed_percent);
}

TEST(AnatomyStudy, theSameSeedGivesTheSamePathsAndStacks) {
  const auto profile = loadProfile(kForearm);
  ASSERT_TRUE(profile.ok());
  const auto hashOf = [&](std::uint64_t seed) {
    const auto report = anatomyStudy(*profile, {.paths = 10, .seed = seed}, [](double) {});
    return report.ok() ? report->hash : 0;
  };
  EXPECT_EQ(hashOf(5), hashOf(5));
  EXPECT_NE(hashOf(5), hashOf(6));
}

TEST(AnatomyStudy, pathsEnterTheSkinAndStayWithinTheNeedlesReach) {
  const auto profile = loadProfile(kForearm);
  ASSERT_TRUE(profile.ok());
  const auto field = fieldOf(profile->volume());
  ASSERT_TRUE(field.ok());
  const auto paths = randomPaths(*field, *profile, 100, 1);
  ASSERT_EQ(paths.size(), 100u);
  for (const AnatomyPath& path : paths) {
    EXPECT_EQ(field->at(path.entry_m - path.axis * 1e-5).structure, kOutside);
    EXPECT_NE(field->at(path.entry_m + path.axis * 1e-5).structure, kOutside);
  }
}

TEST(AnatomyCommand, writesRowsAndAPicture) {
  const TempFolder folder;
  const auto json_file = folder.path() / "rows.json", out = folder.path() / "out";
  const Outcome outcome = sim(
      {"anatomy", kForearm.string(), "--paths", "20", "--json", json_file.string(), "--out", out.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::ifstream file(json_file);
  const auto json = nlohmann::json::parse(file);
  EXPECT_EQ(json["profile"], "forearm-volume");
  EXPECT_EQ(json["paths"], 20);
  EXPECT_EQ(json["rows"].size(), 10u);
  EXPECT_TRUE(std::filesystem::exists(out / "anatomy.csv"));
  EXPECT_TRUE(std::filesystem::exists(out / "section.csv"));
  if (hasGnuplot()) {
    EXPECT_GT(std::filesystem::file_size(out / "anatomy.png"), 10'000u);
  }
}

TEST(AnatomyCommand, aProfileWithoutAVolumeIsWrongInput) {
  const auto shells = std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "db/samples/knee-adult.json";
  const Outcome outcome = sim({"anatomy", shells.string()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              HasSubstr("knee-adult.json: volume: is missing: the study needs a profile with a volume"));
}

}  // namespace
}  // namespace needlelab::test
