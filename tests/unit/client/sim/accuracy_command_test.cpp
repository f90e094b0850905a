/// `needlelab-sim accuracy` through its command line.
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
  const Outcome outcome = sim({"accuracy", "--study", "replay", "--data", "/no/such/folder"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--data /no/such/folder"));
}

TEST(AccuracyCommand, oneStudyGivesTableJsonCsvAndPicture) {
  const TempFolder folder;
  const auto json_file = folder.path() / "rows.json", out = folder.path() / "out";
  const Outcome outcome = sim({"accuracy", "--study", "verification", "--no-instructions", "--loop-seconds",
                               "0.5", "--json", json_file.string(), "--out", out.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("each model against its own closed form"));
  EXPECT_THAT(outcome.out, HasSubstr("→ At 1 kHz the laws miss "));

  std::ifstream file(json_file);
  const auto json = nlohmann::json::parse(file);
  EXPECT_TRUE(json.contains("version"));
  EXPECT_TRUE(json.contains("machine"));
  ASSERT_GE(json["rows"].size(), 100u);
  for (const auto& row : json["rows"]) {
    EXPECT_EQ(row["comparator"], "verification");
    EXPECT_EQ(row["p50_ns"].is_number(), row["rate_hz"] == 1000)
        << "the station's rate is the one that is timed";
    EXPECT_TRUE(row["instructions"].is_null());
    EXPECT_FALSE(row["against"].get<std::string>().empty());
    EXPECT_FALSE(row["cannot_show"].get<std::string>().empty());
  }
  EXPECT_TRUE(std::filesystem::exists(out / "accuracy.csv"));
  if (hasGnuplot()) {
    EXPECT_GT(std::filesystem::file_size(out / "accuracy.png"), 10'000u);
  }
}

}  // namespace
}  // namespace needlelab::test
