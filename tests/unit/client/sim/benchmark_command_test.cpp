// `needlelab-sim benchmark` through its command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "tests/support/recordings/recordings.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

std::string madeData() {
  return (madeRecordings().folder / "needle_force").string();
}

TEST(BenchmarkCommand, givesTablesJsonCsvAndPicture) {
  const TempFolder folder;
  // To keep them for inspection: NEEDLELAB_PICTURES=folder.
  const char* keep = std::getenv("NEEDLELAB_PICTURES");
  const auto out = keep != nullptr ? std::filesystem::path(keep) : folder.path() / "new" / "out";
  const auto json_file = folder.path() / "rows.json";
  const Outcome outcome = sim({"benchmark", "--data", preferredRecordings().folder.string() + "/needle_force",
                               "--out", out.string(), "--json", json_file.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  for (const char* part : {"CONNECT_THE_DOTS", "HOLD_THE_LAST", "RATE_DEPENDENT_FRACTURE",
                           "GORDON_EXPONENTIAL", "held out: blocks", "held out: end", "numbers", "95 % band",
                           "given [µJ]", "cannot tell which model predicts"})
    EXPECT_THAT(outcome.out, HasSubstr(part));
  const auto json = nlohmann::json::parse(*readWholeFile(json_file));
  EXPECT_EQ(json.at("data").at("curves"), 1);
  EXPECT_EQ(json.at("questions").size(), 2u);
  EXPECT_EQ(json.at("most_numbers"), 20);
  std::size_t engine = 0;
  for (const auto& row : json.at("rows")) {
    EXPECT_GE(row.at("max_error_n").get<double>(), row.at("error_n").get<double>());
    if (row.at("kind") != "engine") continue;
    ++engine;
    EXPECT_GT(row.at("median_ns").get<double>(), 0);
    EXPECT_TRUE(row.at("energy_given_j").is_number());
  }
  EXPECT_EQ(engine, 2u * 11u);
  EXPECT_TRUE(std::filesystem::exists(out / "benchmark.csv"));
  if (hasGnuplot()) {
    EXPECT_GT(std::filesystem::file_size(out / "benchmark.png"), 10'000u);
  }
}

TEST(BenchmarkCommand, aFolderOfSpecimensIsAskedAboutAnUnseenOne) {
  const TempFolder folder;
  // 100, 110 and 120 N/m from the surface on: the mean of the two others is off by 15, 0 and 15 N/m
  for (int specimen = 0; specimen < 3; ++specimen) {
    std::string text = "depth_m,force_n\n";
    for (int i = 0; i <= 100; ++i)
      text += std::to_string(1e-4 * i) + "," + std::to_string((100 + 10 * specimen) * 1e-4 * i) + "\n";
    folder.write("s" + std::to_string(specimen) + ".csv", text);
  }
  std::string curves;
  for (const char* specimen : {"0", "1", "2"})
    curves += std::string(curves.empty() ? "" : ",") + R"({"file": "s)" + specimen +
              R"(.csv", "specimen": ")" + specimen +
              R"(", "needle": "18G", "tissue": "gel", "speed_m_s": 0.003})";
  folder.write("data_set.json", R"({"name": "gels", "licence": "CC0", "curves": [)" + curves + "]}");
  const Outcome outcome =
      sim({"benchmark", "--data", folder.path().string(), "--held-out", "specimen", "--no-times", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json.at("data").at("licence"), "CC0");
  EXPECT_EQ(json.at("questions").at(0).at("units"),
            (std::vector<std::string>{"gel, 0, 0.003 m/s", "gel, 1, 0.003 m/s", "gel, 2, 0.003 m/s"}));
  const auto& dots = json.at("rows").at(0);
  EXPECT_EQ(dots.at("model"), "CONNECT_THE_DOTS");
  const auto errors = dots.at("unit_errors_n").get<std::vector<double>>();
  // rms of 15 N/m × depth over bins from 0 to 10 mm: 15 × 10 mm/√3
  EXPECT_NEAR(errors.at(0), 0.15 / std::sqrt(3), 0.003);
  EXPECT_NEAR(errors.at(1), 0, 1e-3);
  EXPECT_NEAR(errors.at(2), 0.15 / std::sqrt(3), 0.003);
}

TEST(BenchmarkCommand, withoutTimesTheSameDataGiveTheSameBytes) {
  const std::vector<std::string> command = {"benchmark",  "--data",    madeData(), "--held-out", "end",
                                            "--no-times", "--numbers", "10",       "--json"};
  const Outcome a = sim(command), b = sim(command);
  ASSERT_EQ(a.code, 0) << a.err;
  EXPECT_EQ(a.out, b.out);
  const auto json = nlohmann::json::parse(a.out);
  for (const auto& row : json.at("rows")) {
    EXPECT_TRUE(row.at("median_ns").is_null());
    EXPECT_EQ(row.at("held_out"), "end");
  }
}

TEST(BenchmarkCommand, refusesWrongInputBeforeTheWork) {
  const TempFolder folder;
  const std::string description = folder.write("about.json", R"({"curves": 3})").string();
  const std::vector<Refused> cases = {
      {{}, {"--data"}},
      {{"--data", "/no/such/folder"}, {"/no/such/folder"}},
      {{"--data", folder.path().string()}, {"no force curve"}},
      {{"--data", madeData(), "--numbers", "6"}, {"--numbers", "7 to 100"}},
      {{"--data", madeData(), "--numbers", "-4"}, {"--numbers"}},
      {{"--data", madeData(), "--margin", "0"}, {"--margin", "1"}},
      {{"--data", madeData(), "--calibrate", "51"}, {"--calibrate", "50"}},
      {{"--data", madeData(), "--held-out", "weather"}, {"--held-out"}},
      {{"--data", madeData(), "--describe", description}, {"about.json", "curves"}},
      {{"--data", madeData(), "--describe", "/no/such/file"}, {"/no/such/file"}},
      {{"--data", madeData(), "--out", madeData()}, {"--out", "folder of the data"}},
      {{"--data", madeData(), "--json", madeData() + "/bovine_liver_heart_18g.csv"},
       {"bovine_liver_heart_18g"}},
      {{"--data", madeData(), "--json", folder.path().string() + "/none/rows.json"}, {"none/rows.json"}},
  };
  expectRefused("benchmark", cases);
}

}  // namespace
}  // namespace needlelab::test
