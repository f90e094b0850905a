// Each axial model runs live: real stations, headless, with the simulated hand and device at 1 kHz.
#include <gmock/gmock.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/haptics/axial_model.h"
#include "tests/integration/lab.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

TEST(LiveModels, everyModelRendersAnInsertionInTheStation) {
  const TempFolder folder;
  struct Run {
    std::string model;
    std::unique_ptr<Process> station;
  };
  // all in parallel: a tick takes some µs of each ms, so the test lasts as long as one run
  std::vector<Run> runs;
  for (const std::string_view name : kAxialModelNames) {
    const std::string model(name);
    runs.push_back({model, std::make_unique<Process>(
                               "needlelab-station",
                               std::vector<std::string>{
                                   "--profile", NEEDLELAB_SAMPLES "/shoulder-models.json", "--model", model,
                                   "--headless", "--seconds", "5", "--spool", folder.path() / model, "--json",
                                   folder.path() / (model + ".json")},
                               folder.path() / (model + ".log"))});
  }
  for (Run& run : runs) {
    SCOPED_TRACE(run.model);
    ASSERT_EQ(run.station->wait(), kExitDone) << run.station->said();
    const auto text = readWholeFile(folder.path() / (run.model + ".json"));
    ASSERT_TRUE(text.ok());
    const auto row = nlohmann::json::parse(*text)["rows"][0];
    EXPECT_EQ(row["axial_model"], run.model);
    EXPECT_TRUE(row["fault"].is_null()) << row["fault"];
    EXPECT_EQ(row["samples"].get<int>() + row["missed_ticks"].get<int>(), row["ticks"].get<int>());
    EXPECT_GE(row["events"]["entries into the tissue"], 1);
    EXPECT_GT(scoreOf(row, "greatest_insertion_m"), 0.005);
    EXPECT_GT(scoreOf(row, "peak_force_n"), 0.2);
    EXPECT_LE(scoreOf(row, "peak_force_n"), 10.001);
  }
}

}  // namespace
}  // namespace needlelab::test
