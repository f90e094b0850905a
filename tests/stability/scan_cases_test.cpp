// The closed-loop cases of stiffness, release, reversal and late ticks; each with a control that fails.
#include <gtest/gtest.h>

#include <utility>

#include "tests/stability/case_rows.h"

namespace needlelab::test {
namespace {

constexpr AxialModel kWall = AxialModel::kEnhancedTrackingWall;

::testing::AssertionResult isStable(const CaseRow& row) {
  return (row.verdict == Verdict::kStable ? ::testing::AssertionSuccess() : ::testing::AssertionFailure())
         << row.case_name << " " << rowText(row);
}

// the engine, but the scene is changed before it is compiled
ForceSourceFactory changed(void (*change)(SceneSpec&)) {
  return [change](SceneSpec scene, double rate_hz) {
    change(scene);
    return engineSource()(scene, rate_hz);
  };
}

// the engine with a defect behind it
class AfterEngine : public ForceSource {
 public:
  explicit AfterEngine(std::unique_ptr<ForceSource> engine) : engine_(std::move(engine)) {}
  [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
    return engine_->axialStiffness_N_per_m();
  }

 protected:
  void engineStep(const TipSample& tip, StepReport& report) noexcept { engine_->step(tip, report); }

 private:
  std::unique_ptr<ForceSource> engine_;
};
template <class Source>
Result<std::unique_ptr<ForceSource>> with(const SceneSpec& scene, double rate_hz) {
  auto engine = engineSource()(scene, rate_hz);
  if (!engine.ok()) return engine.error();
  return std::unique_ptr<ForceSource>(std::make_unique<Source>(std::move(engine).value()));
}

// it returns the force of the previous tick
class LateByATick final : public AfterEngine {
 public:
  using AfterEngine::AfterEngine;
  void step(const TipSample& tip, StepReport& report) noexcept override {
    engineStep(tip, report);
    std::swap(report.wrench_W, before_);
  }

 private:
  Wrench before_;
};

// a damper of 5 N·s/m beside the wall, its speed from the last two ticks
class DamperOverATick final : public AfterEngine {
 public:
  using AfterEngine::AfterEngine;
  void step(const TipSample& tip, StepReport& report) noexcept override {
    engineStep(tip, report);
    if (report.depth_m > 0) report.wrench_W.force_N += (before_W_m_ - tip.p_WT_m) * (5.0 / 1e-3);
    before_W_m_ = tip.p_WT_m;
  }

 private:
  Vec3 before_W_m_;
};

TEST(StiffnessScan, everyNudgeDiesOutBelowTheLimitOfTheory) {
  EXPECT_TRUE(isStable(rowOf("stiffness_scan")));
}
TEST(StiffnessScan, controlAnEngineThatIsOneTickLateSwingsOn) {
  EXPECT_FALSE(isStable(rowOf("stiffness_scan", kWall, with<LateByATick>)));
}

TEST(OverLimitBounded, theForceStaysBetweenCuttingAndAttraction) {
  EXPECT_TRUE(isStable(rowOf("over_limit_bounded")));
}
TEST(OverLimitBounded, controlASpringWithoutEndIsNotBounded) {
  const auto spring = changed([](SceneSpec& scene) {
    scene.axial_model = AxialModel::kDirect;
    scene.direct = {scene.tracking_wall.stiffness_N_per_m, false};
  });
  EXPECT_FALSE(isStable(rowOf("over_limit_bounded", kWall, spring)));
}

TEST(FreeHandRelease, theNeedleStaysWhereItWas) {
  EXPECT_TRUE(isStable(rowOf("free_hand_release")));
}
TEST(FreeHandRelease, controlARampThatDoesNotLookAtTheNeedlePullsItOut) {
  EXPECT_FALSE(isStable(rowWith(Defect::kRampIgnoresZ, "free_hand_release")));
}
TEST(FreeHandRelease, controlAForceStepThrowsTheNeedleOut) {
  EXPECT_FALSE(isStable(rowOf("free_hand_release", AxialModel::kDirect)));
}

TEST(SkinFlutter, theHandGetsNoEnergyFromTheSkin) {
  EXPECT_TRUE(isStable(rowOf("skin_flutter")));
}
TEST(SkinFlutter, controlAForceStepAtTheSkinGivesEnergy) {
  const auto step = changed([](SceneSpec& scene) {
    scene.axial_model = AxialModel::kDirect;
    scene.direct = {10'000, true};  // the layer's full force within 0.1 mm
  });
  EXPECT_FALSE(isStable(rowOf("skin_flutter", kWall, step)));
}

TEST(FrictionReversal, theForceStandsStillAfterIt) {
  EXPECT_TRUE(isStable(rowOf("friction_reversal")));
}
TEST(FrictionReversal, soItDoesWithTheFrictionOfOkamuraAndOfDahl) {
  for (const AxialModel model : {AxialModel::kOkamura, AxialModel::kDahl})
    EXPECT_TRUE(isStable(rowOf("friction_reversal", model))) << axialModelName(model);
}
TEST(FrictionReversal, controlFrictionBySignOfTheSpeedChatters) {
  EXPECT_FALSE(isStable(rowWith(Defect::kFrictionBySign, "friction_reversal")));
}

TEST(LateAndMissingTicks, theHoldStandsStill) {
  EXPECT_TRUE(isStable(rowOf("late_and_missing_ticks")));
}
TEST(LateAndMissingTicks, controlADamperOverOneTickShakes) {
  EXPECT_FALSE(isStable(rowOf("late_and_missing_ticks", kWall, with<DamperOverATick>)));
}

}  // namespace
}  // namespace needlelab::test
