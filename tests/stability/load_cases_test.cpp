// The closed-loop cases of a load: the wall passes each case, and a control fails it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/stability/case_rows.h"
#include "tests/stability/changed_source.h"

namespace needlelab::test {
namespace {

constexpr AxialModel kLoaded = AxialModel::kEnhancedTrackingWall;

TEST(ReleaseUnderLoad, controlAForceThatKeepsItsSizeGivesMore) {
  const CaseRow row = rowOf("release_under_load", AxialModel::kDirect);
  EXPECT_FALSE(isStable(row));
  // 4 N over 18 mm of tissue, compared with 4²/(2·500) J
  EXPECT_GT(*row.measured, 3.5) << rowText(row);
}
TEST(ReleaseUnderLoad, controlAMembraneThatPushesHarderOutThanInGivesMore) {
  // 1.2 times the force while the depth decreases
  double depth_m = 0;
  const CaseRow row = rowOf("release_under_load", kLoaded,
                            changed([depth_m](const TipSample&, ForceSource&, StepReport& r) mutable {
                              if (r.depth_m < depth_m) r.wrench_W.force_N = r.wrench_W.force_N * 1.2;
                              depth_m = r.depth_m;
                            }));
  EXPECT_FALSE(isStable(row));
  EXPECT_GT(*row.measured, 1.1) << rowText(row);
}

TEST(DeratedRelease, theForceFallsAndRisesWithoutAStep) {
  const CaseRow row = rowOf("derated_release");
  // the gate lets it rise by 10 N/s
  EXPECT_LE(*row.measured, 0.0101) << rowText(row);
}
// a switch instead of a level: halves the force permanently once the mean square of the last seconds exceeds
// that of 3.5 N
TEST(DeratedRelease, controlAThermostatSteps) {
  double heat_N2 = 0;
  bool hot = false;
  const auto thermostat = [heat_N2, hot](const TipSample&, ForceSource&, StepReport& r) mutable {
    heat_N2 += (normSquared(r.wrench_W.force_N) - heat_N2) * 3e-4;
    hot = hot || heat_N2 > 3.5 * 3.5;
    if (hot) r.wrench_W.force_N = r.wrench_W.force_N * 0.5;
  };
  const CaseRow row = rowOf("derated_release", kLoaded, changed(thermostat));
  EXPECT_TRUE(row.applicable);
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_GT(*row.measured, 0.5) << rowText(row);
}

TEST(LeverClamping, thePushAsideDiesOut) {
  const CaseRow row = rowOf("lever_clamping");
  // b + b_hand of 3.5 N·s/m and 0.06 N·m·s/rad through the lever, over T (½ + d) and the fixture's stiffness
  const double lever2 = 0.012 * 0.012 + 0.008 * 0.008 + 0.13 * 0.13;
  const double across = 1 / (1 / 3.5 + lever2 / 0.06) / 1.5e-3 / *row.coupled_margin;
  EXPECT_NEAR(across, 410, 10) << "k of 400 N/m, and 2 k'e s of its last millimetres";
  EXPECT_NEAR(*row.passive_margin, 1 / (1 / 0.5 + lever2 / 0.01) / 1.5e-3 / across, 1e-6);
}
// 2.0 kN/m: with the hand at the needle, theory allows 2,333; through the lever, 1,170
void stiffFixture(SceneSpec& scene) {
  for (LayerSpec& layer : scene.layers) layer.lateral_stiffness_N_per_m2 *= 10;
  scene.virtual_fixture.max_stiffness_N_per_m = 2000;
}
TEST(LeverClamping, controlAFixtureTooStiffForTheLeverSwings) {
  EXPECT_FALSE(isStable(rowOf("lever_clamping", kLoaded, ofScene(stiffFixture))));
}
TEST(LeverClamping, theSameFixtureIsStableWithoutTheLever) {
  EXPECT_TRUE(isStable(rowWithField("lever_clamping", "plant", {{"tool_z_m", 0}}, ofScene(stiffFixture))));
}

TEST(ObliqueBone, holdsAtAnyAngleOnEachDevice) {
  const CaseRow row = rowOf("oblique_bone");
  // the Falcon's 1.0 N·s/m over T (½ + d) and 1000 N/m, alone and with the hand's 3 N·s/m
  EXPECT_NEAR(*row.passive_margin, 1.0 / 1.5e-3 / 1000, 1e-9);
  EXPECT_NEAR(*row.coupled_margin, 4.0 / 1.5e-3 / 1000, 1e-9);
}
TEST(ObliqueBone, controlBoneThatIsALayerToCutLetsTheNeedleIn) {
  const CaseRow row = rowOf("oblique_bone", kLoaded,
                            ofScene([](SceneSpec& scene) { scene.effects &= ~bitOf(Effect::kBone); }));
  EXPECT_FALSE(isStable(row));
}
TEST(ObliqueBone, controlBoneStifferThanTheLoopHoldsSwings) {
  const CaseRow row = rowOf("oblique_bone", kLoaded, ofScene([](SceneSpec& scene) {
                              scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] = 5000;
                            }));
  EXPECT_FALSE(isStable(row));
  EXPECT_GT(*row.measured, 0.2) << rowText(row);
}

TEST(FreeHandNoFriction, itSwingsAboutTheWallAndNoFurther) {
  const CaseRow row = rowOf("free_hand_no_friction");
  // no hand: coupled and passive limits are the same, and 0.5 N·s/m are passive up to 333 N/m
  EXPECT_NEAR(*row.passive_margin, 0.5 / 1.5e-3 / 500, 1e-9);
  EXPECT_EQ(*row.coupled_margin, *row.passive_margin);
}
TEST(FreeHandNoFriction, controlARampIgnoringTheNeedlePullsItOut) {
  EXPECT_FALSE(isStable(rowWith(Defect::kRampIgnoresZ, "free_hand_no_friction")));
}
TEST(FreeHandNoFriction, controlAForceStepThrowsTheNeedleOut) {
  EXPECT_FALSE(isStable(rowOf("free_hand_no_friction", AxialModel::kDirect)));
}

TEST(LoadCases, everyModelHasAFiniteRow) {
  std::vector<std::string> names = {"tool_gestures"};
  for (const StabilityCase& one : loadCases()) names.push_back(one.name);
  for (const std::string& name : names)
    for (const AxialModel model :
         {AxialModel::kTrackingWall, AxialModel::kDirect, AxialModel::kVoigt, AxialModel::kGodObject,
          AxialModel::kFirstOrder, AxialModel::kStatistical, AxialModel::kPrecomputed}) {
      const CaseRow row = rowOf(name, model);
      EXPECT_TRUE(!row.applicable || row.finite) << name << ", " << axialModelName(model);
    }
}

}  // namespace
}  // namespace needlelab::test
