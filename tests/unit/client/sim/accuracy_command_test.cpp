/// `needlelab-sim accuracy` from its command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "client/sim/tools/gnuplot.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

TEST(AccuracyCommand, anUnknownStudyIsWrongUsage) {
  const Outcome outcome = sim({"accuracy", "--study", "weather"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--study"));
}

TEST(AccuracyCommand, dataThatIsNoFolderIsWrongUsage) {
  const Outcome outcome = sim({"accuracy", "--study", "live", "--data", "/no/such/folder"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--data /no/such/folder"));
}

TEST(AccuracyCommand, oneStudyGivesTableJsonCsvAndPicture) {
  const TempFolder folder;
  const auto json_file = folder.path() / "rows.json", out = folder.path() / "out";
  const Outcome outcome =
      sim({"accuracy", "--study", "live", "--json", json_file.string(), "--out", out.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("recommendation, computed from these rows"));
  EXPECT_THAT(outcome.out, HasSubstr("latency [ms]"));

  std::ifstream file(json_file);
  const auto json = nlohmann::json::parse(file);
  EXPECT_TRUE(json.contains("version"));
  EXPECT_TRUE(json.contains("machine"));
  ASSERT_GE(json["rows"].size(), 5u);
  for (const auto& row : json["rows"]) {
    EXPECT_EQ(row["study"], "live");
    EXPECT_TRUE(row["frame_s"].is_number());
    EXPECT_TRUE(row["mesh_nodes"].is_null());
    EXPECT_FALSE(row["reference"].get<std::string>().empty());
    EXPECT_FALSE(row["uncertainty"].get<std::string>().empty());
    EXPECT_FALSE(row["cannot_show"].get<std::string>().empty());
  }
  EXPECT_TRUE(std::filesystem::exists(out / "accuracy.csv"));
  if (hasGnuplot()) {
    EXPECT_GT(std::filesystem::file_size(out / "accuracy_live.png"), 10'000u);
  }
}

TEST(AccuracyCommand, jsonOnStandardOutputIsAlone) {
  const Outcome outcome = sim({"accuracy", "--study", "live", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(nlohmann::json::accept(outcome.out));
}

}  // namespace
}  // namespace needlelab::test
