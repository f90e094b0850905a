// The passivity control: with it the wall passes each case, without it the loops give energy.
#include <gtest/gtest.h>

#include <string>

#include "client/sim/tools/hand_thresholds.h"
#include "tests/stability/case_rows.h"
#include "tests/stability/changed_source.h"

namespace needlelab::test {
namespace {

TEST(PassivityControlCases, theFadeInGivesNothing) {
  const CaseRow row = rowOf("passivity_fade_in");
  EXPECT_EQ(row.verdict, Verdict::kStable) << rowText(row);
  EXPECT_GT(*row.grip_energy_J, 1e-3) << "control: without it the gate's share makes a pressed spring give";
  EXPECT_LE(*row.controlled_energy_J, 5e-5);
  EXPECT_GT(*row.distortion_N, kNoticeableStep_N) << "and this is its price";
}

TEST(PassivityControlCases, aDeratedLoadGivesNothingAndIsHardlyTouched) {
  const CaseRow row = rowOf("passivity_derated");
  EXPECT_EQ(row.verdict, Verdict::kStable) << rowText(row);
  // a hundredth of the load: the loop is not passive, and the free needle swings about a stationary wall
  EXPECT_LE(*row.distortion_N, 0.045);
}
// 2.5 N, which the motors bear: without derating the case says nothing, and does not count as stable
TEST(PassivityControlCases, controlALoadThatIsNotDeratedDoesNotPass) {
  const auto scene = nlohmann::json::parse(R"({"layers": [{"tissue": "OTHER", "thickness_m": 0.05,
      "cutting_force_n": 2.5, "attracted_force_n": 0.5, "rejection_force_n": 0.1}]})");
  const CaseRow row = rowWithField("passivity_derated", "scene_patch", scene);
  EXPECT_FALSE(isStable(row)) << rowText(row);
  EXPECT_FALSE(row.applicable) << rowText(row);
}

// 1.5 times the force on the way out: the energy that such a faulty engine would give is removed
TEST(PassivityControlCases, controlAnEngineThatGivesEnergyIsNotLeftAsItIs) {
  double depth_m = 0;
  const CaseRow row = rowOf("passivity_transparent", AxialModel::kEnhancedTrackingWall,
                            changed([depth_m](const TipSample&, ForceSource&, StepReport& r) mutable {
                              if (r.depth_m < depth_m) r.wrench_W.force_N = r.wrench_W.force_N * 3;
                              depth_m = r.depth_m;
                            }));
  EXPECT_FALSE(row.passed) << rowText(row);
}

// ten times the fixture that the station would have lowered: no hand in the case can hold it through the
// lever
TEST(ToolGestures, controlAnUnloweredFixtureGivesEnergy) {
  const ForceSourceFactory stiff = [](SceneSpec scene, double rate_hz) {
    for (LayerSpec& layer : scene.layers) layer.lateral_stiffness_N_per_m2 *= 20;
    scene.virtual_fixture.max_stiffness_N_per_m = 4000;
    return engineSource()(scene, rate_hz);
  };
  const CaseRow row = rowOf("tool_gestures", AxialModel::kEnhancedTrackingWall, stiff);
  EXPECT_FALSE(row.passed) << rowText(row);
}

}  // namespace
}  // namespace needlelab::test
