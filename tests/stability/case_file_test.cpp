// cases.json: errors name file, case and field.
#include "client/sim/stability/case_file.h"

#include <gtest/gtest.h>

#include "client/sim/stability/case.h"

namespace needlelab {
namespace {

// the compiled-in file, changed by a JSON merge patch
Result<CaseFile> patched(const char* patch) {
  const auto file = CaseFile::embedded();
  nlohmann::json json = file->json();
  json.merge_patch(nlohmann::json::parse(patch));
  return CaseFile::parse(json.dump(), "my.json");
}

std::string faultOf(const char* patch) {
  const auto file = patched(patch);
  if (!file.ok()) return file.error().message;
  for (const StabilityCase& one : holdCases()) {
    if (one.name != "hold_quantised") continue;
    const auto outcome = runCase(one, {*file, false}, AxialModel::kEnhancedTrackingWall, engineSource());
    return outcome.ok() ? "" : outcome.error().message;
  }
  return "no such case";
}

TEST(CaseFile, containsEveryCaseOfTheProgram) {
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok()) << file.error().message;
  for (const StabilityCase& one : allCases())
    EXPECT_TRUE(file->json().at("cases").contains(one.name)) << one.name;
}

TEST(CaseFile, whatIsWrongIsNamed) {
  EXPECT_EQ(faultOf("{}"), "");
  EXPECT_EQ(faultOf(R"({"version": 7})"), "my.json: version: must be 1");
  EXPECT_EQ(faultOf(R"({"cases": null})"), "my.json: cases: must be an object");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": null}})"), "my.json: cases.hold_quantised: missing");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": {"limit": null}}})"),
            "my.json: cases.hold_quantised.limit: missing");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": {"limit": -1}}})"),
            "my.json: cases.hold_quantised.limit: -1 is out of range [0, 1e+09]");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": {"limit": "much"}}})"),
            "my.json: cases.hold_quantised.limit: must be a number");
  EXPECT_EQ(
      faultOf(R"({"cases": {"hold_quantised": {"scene": "moon"}}})"),
      "my.json: cases.hold_quantised.scene: there is no scene 'moon' in this file, and no such patient in db/samples");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": {"window": {"step": "rest"}}}})"),
            "my.json: cases.hold_quantised.window.step: the path has no step 'rest'");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": {"plant": {"gravity": 9.81}}}})"),
            "my.json: cases.hold_quantised.plant.gravity: unknown");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": {"plant": {"delay_ticks": 1.5}}}})"),
            "my.json: cases.hold_quantised.plant.delay_ticks: must be a whole number, 0 to 15");
  EXPECT_EQ(faultOf(R"({"cases": {"hold_quantised": {"like": "moon"}}})"), "my.json: cases.moon: missing");
  // an invalid profile as the scene, and an invalid device
  EXPECT_NE(faultOf(R"({"scenes": {"one_layer": {"max_force_n": 99}}})").find("max_force_n: 99"),
            std::string::npos);
  EXPECT_NE(faultOf(R"({"cases": {"hold_quantised": {"plant": {"mass_kg": 0}}}})").find("mass in kg: 0"),
            std::string::npos);
}

TEST(CaseEntry, readsPathsAndWindowsInTime) {
  const auto file = CaseFile::embedded();
  CaseEntry entry(*file, "hold_quantised");
  const TimedPlan path = entry.path();
  const TimeWindow window = entry.window(path);
  ASSERT_TRUE(entry.status().ok());
  ASSERT_EQ(path.steps.size(), 3U);
  // 0.3 s of rest, 17 mm at up to 20 mm/s, with 15 % of the time for acceleration and for deceleration
  EXPECT_NEAR(path.steps[1].to_s, 0.3 + 0.017 / 0.02 / 0.85, 1e-9);
  EXPECT_NEAR(window.from_s, path.steps[2].from_s + 3, 1e-9);
  EXPECT_NEAR(window.to_s, path.plan.duration_s(), 1e-9);
  EXPECT_NEAR(path.plan.end().X_WT.p.z, -0.012, 1e-12);
  // shifted by 1 mm, and slower
  const TimedPlan slower = entry.path("path", {0.001, 0.5});
  EXPECT_NEAR(slower.plan.end().X_WT.p.z, -0.013, 1e-12);
  EXPECT_NEAR(slower.steps[1].to_s, 0.3 + 0.018 / 0.01 / 0.85, 1e-9);
}

TEST(CaseEntry, takesTheNumbersOfTheForm) {
  const auto file = patched(R"({"cases": {"hold_quantised": {"n": {"short": 3, "long": 30}}}})");
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(CaseEntry(*file, "hold_quantised", false).whole("n"), 3U);
  EXPECT_EQ(CaseEntry(*file, "hold_quantised", true).whole("n"), 30U);
  CaseEntry wrong(*file, "hold_quantised");
  wrong.whole("limit");
  EXPECT_EQ(wrong.status().error().message, "my.json: cases.hold_quantised.limit: must be a whole number");
}

}  // namespace
}  // namespace needlelab
