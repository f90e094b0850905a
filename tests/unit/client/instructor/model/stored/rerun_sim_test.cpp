// Compares a re-run with `needlelab-sim run` on the same poses, exported as CSV.
#include <gtest/gtest.h>

#include "client/instructor/model/stored/report.h"
#include "client/instructor/model/stored/rerun.h"
#include "client/sim/tools/offline_scene.h"
#include "client/sim/tools/run_table.h"
#include "common/gesture/sample.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/instructor/model/lesson_gestures.h"

namespace needlelab {
namespace {

/// Returns the table of `needlelab-sim run` without its times.
std::string simTable(const std::filesystem::path& profile, const std::filesystem::path& poses,
                     const std::string& model) {
  OfflineOptions options;
  options.profile = profile;
  options.trajectory = poses;
  options.model = model;
  const auto scene = loadOffline(options);
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  std::string table;
  const auto state = std::make_unique<SimState>();
  StepReport report;
  for (std::size_t i = 0; i < scene->track.t_s.size(); ++i) {
    step(scene->model, scene->tip(i), *state, report);
    appendRunRow(table, 0, report, scene->model.needle_length_m);
  }
  return table;
}

TEST(RerunSim, giveTheSameBits) {
  const test::TempFolder folder;
  const auto gesture = test::lesson({.depth_m = 0.022, .seconds = 1.5, .aside_m = 0.004});
  const auto poses = folder.path() / "poses.csv";
  ASSERT_TRUE(writeSamplesCsv(*gesture, poses).ok());
  for (const auto& [name, model] : std::vector<std::pair<std::string, std::string>>{
           {"shoulder-adult", ""}, {"shoulder-muscular", ""}, {"shoulder-adult", "VOIGT"}}) {
    const std::string json = test::sampleProfile(name);
    std::string table;
    const double length_m = test::viewOfProfile(json).needle.length_m;
    const auto run = rerunGesture(*gesture, {json, model}, {}, {}, [&](const StepReport& report) {
      appendRunRow(table, 0, report, length_m);
    });
    ASSERT_TRUE(run.ok()) << run.error().message;
    EXPECT_EQ(fnv1a(table),
              fnv1a(simTable(std::string(NEEDLELAB_SAMPLES) + "/" + name + ".json", poses, model)))
        << name << " " << model;
    EXPECT_GT(table.size(), 10'000u);
  }
}

}  // namespace
}  // namespace needlelab
