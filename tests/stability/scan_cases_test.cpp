// The closed-loop cases of stiffness, release, reversal and late ticks; each with a control that fails.
#include <gtest/gtest.h>

#include <utility>

#include "tests/stability/case_rows.h"
#include "tests/stability/changed_source.h"

namespace needlelab::test {
namespace {

constexpr AxialModel kWall = AxialModel::kEnhancedTrackingWall;

TEST(StiffnessScan, controlAnEngineThatIsOneTickLateSwingsOn) {
  const auto late = changed([before = Wrench{}](const TipSample&, ForceSource&, StepReport& r) mutable {
    std::swap(r.wrench_W, before);
  });
  EXPECT_FALSE(isStable(rowOf("stiffness_scan", kWall, late)));
}

TEST(OverLimitBounded, controlASpringWithoutEndIsNotBounded) {
  const auto spring = ofScene([](SceneSpec& scene) {
    scene.axial_model = AxialModel::kDirect;
    scene.direct = {scene.tracking_wall.stiffness_N_per_m, false};
  });
  EXPECT_FALSE(isStable(rowOf("over_limit_bounded", kWall, spring)));
}

TEST(FreeHandRelease, controlARampIgnoringTheNeedlePullsItOut) {
  EXPECT_FALSE(isStable(rowWith(Defect::kRampIgnoresZ, "free_hand_release")));
}
TEST(FreeHandRelease, controlAForceStepThrowsTheNeedleOut) {
  EXPECT_FALSE(isStable(rowOf("free_hand_release", AxialModel::kDirect)));
}

TEST(SkinFlutter, controlAForceStepAtTheSkinGivesEnergy) {
  const auto step = ofScene([](SceneSpec& scene) {
    scene.axial_model = AxialModel::kDirect;
    scene.direct = {10'000, true};  // the layer's full force within 0.1 mm
  });
  EXPECT_FALSE(isStable(rowOf("skin_flutter", kWall, step)));
}

TEST(FrictionReversal, soItDoesWithTheFrictionOfOkamuraAndOfDahl) {
  for (const AxialModel model : {AxialModel::kOkamura, AxialModel::kDahl})
    EXPECT_TRUE(isStable(rowOf("friction_reversal", model))) << axialModelName(model);
}
TEST(FrictionReversal, controlFrictionBySignOfTheSpeedChatters) {
  EXPECT_FALSE(isStable(rowWith(Defect::kFrictionBySign, "friction_reversal")));
}

// a damper of 5 N·s/m beside the wall; its speed comes from the last two ticks
TEST(LateAndMissingTicks, controlADamperOverOneTickShakes) {
  const auto damper =
      changed([before_W_m = Vec3{}](const TipSample& tip, ForceSource&, StepReport& r) mutable {
        if (r.depth_m > 0) r.wrench_W.force_N += (before_W_m - tip.p_WT_m) * (5.0 / 1e-3);
        before_W_m = tip.p_WT_m;
      });
  EXPECT_FALSE(isStable(rowOf("late_and_missing_ticks", kWall, damper)));
}

}  // namespace
}  // namespace needlelab::test
