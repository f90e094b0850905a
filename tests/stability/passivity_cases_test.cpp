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
  EXPECT_GT(*row.grip_energy_J, 1e-3) << "control: without it the gate's share makes a pressed spring give";
  EXPECT_LE(*row.controlled_energy_J, 5e-5);
  EXPECT_GT(*row.distortion_N, kNoticeableStep_N) << "and this is its price";
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
