// The cases of prescribed motion: the wall passes each case, and its target defect fails.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/haptics/models/like_for_like.h"
#include "tests/stability/case_rows.h"
#include "tests/stability/changed_source.h"
#include "tests/support/reference/reference_source.h"

namespace needlelab::test {
namespace {

CaseRow wallRow(std::string_view name, const ForceSourceFactory& source = engineSource()) {
  return rowOf(name, AxialModel::kEnhancedTrackingWall, source);
}

// the reference is a second engine written from the text alone: if it failed a case, the case would be wrong
TEST(ReferenceStands, allCasesWithoutAPlantedDefect) {
  for (const StabilityCase& one : motionCases()) {
    if (one.name == "flipped_axis") continue;  // slow with the reference
    const CaseRow row = wallRow(one.name, referenceSource());
    EXPECT_TRUE(row.passed) << rowText(row);
  }
}

struct Control {
  const char* name;
  Defect defect;
  double at_least;  // times the limit
};
class DefectFails : public testing::TestWithParam<Control> {};
TEST_P(DefectFails, theSameCheck) {
  const auto [name, defect, at_least] = GetParam();
  const CaseRow row = wallRow(name, referenceSource(defect));
  EXPECT_FALSE(row.passed) << rowText(row);
  ASSERT_TRUE(row.measured && row.limit);
  EXPECT_GE(*row.measured, at_least * *row.limit) << rowText(row);
}
INSTANTIATE_TEST_SUITE_P(Motion, DefectFails,
                         testing::Values(Control{"retreat_in_ramp", Defect::kRampIgnoresZ, 20},
                                         Control{"tilt_pump", Defect::kAlphaWithoutState, 1000},
                                         Control{"exit_normal", Defect::kAttractedNotFaded, 10},
                                         Control{"starts_inside", Defect::kEntersFromInside, 1}),
                         [](const auto& test) { return std::string(test.param.name); });

// a tip that may advance by only one layer of 0.2 mm per tick of 1 ms
TEST(LayersInOneTick, anEngineThatTakesThemOneByOneFails) {
  class OneByOne final : public ForceSource {
   public:
    OneByOne(std::unique_ptr<ForceSource> inner, double layers_per_tick)
        : inner_(std::move(inner)), most_m_(2e-4 * layers_per_tick) {}
    void step(const TipSample& tip, StepReport& report) noexcept override {
      TipSample late = tip;
      if (begun_) late.p_WT_m.z = std::clamp(tip.p_WT_m.z, z_m_ - most_m_, z_m_ + most_m_);
      begun_ = true;
      z_m_ = late.p_WT_m.z;
      inner_->step(late, report);
    }
    [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
      return inner_->axialStiffness_N_per_m();
    }

   private:
    std::unique_ptr<ForceSource> inner_;
    double most_m_, z_m_ = 0;
    bool begun_ = false;
  };
  const auto one_by_one = [](const SceneSpec& scene, double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    auto inner = engineSource()(scene, rate_hz);
    if (!inner.ok()) return inner.error();
    return std::unique_ptr<ForceSource>(std::make_unique<OneByOne>(std::move(*inner), 1));
  };
  const CaseRow row = wallRow("layers_in_one_tick", one_by_one);
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_GE(*row.measured, 0.3) << "attracted force outside the tissue";
}

// a plausible but wrong guard: no force where the needle cannot be
TEST(BeyondTheNeedle, cuttingTheForceOffThereFails) {
  const CaseRow row = wallRow("beyond_the_needle", changed([](const TipSample&, ForceSource&, StepReport& r) {
                                if (r.flags & kFlagBeyondNeedle) r.wrench_W = {};
                              }));
  EXPECT_FALSE(row.passed);
  EXPECT_GE(*row.measured, 1.0);
}

// fuzzing finds a defect in far fewer ticks than are needed to show that there is none
CaseRow flippedRow(const ForceSourceFactory& source) {
  return rowWithField("flipped_axis", "fuzzed_ticks", 20'000, source);
}

class NoGateFails : public testing::TestWithParam<const char*> {};
TEST_P(NoGateFails, theSameCheck) {
  const CaseRow row = rowOf(GetParam(), AxialModel::kEnhancedTrackingWall, engineSource(), withoutGate());
  EXPECT_FALSE(row.passed) << rowText(row);
}
INSTANTIATE_TEST_SUITE_P(Motion, NoGateFails, testing::Values("teleport", "not_a_number", "frozen_device"),
                         [](const auto& test) { return std::string(test.param); });

// a plain spring instead of the wall keeps pushing a hand that rests, or a device that froze
TEST(FrozenDevice, aSpringDoesNotLetGo) {
  for (const AxialModel model : {AxialModel::kDirect, AxialModel::kVoigt}) {
    const CaseRow row = wallRow("frozen_device", [model](const SceneSpec& scene, double rate_hz) {
      return engineSource()(likeForLike(scene, model), rate_hz);
    });
    EXPECT_FALSE(row.passed) << axialModelName(model);
    EXPECT_GT(*row.measured, 0.3);
  }
}

TEST(FlippedAxis, aTrajectoryThatFollowsTheNeedleFails) {
  const CaseRow row = flippedRow(changed([](const TipSample& tip, ForceSource& inner, StepReport& r) {
    if (!isFinite(tip.q_WT) || !isFinite(tip.p_WT_m)) return;
    const double along = dot(inner.trajectory(), r.wrench_W.force_N);
    r.wrench_W.force_N = zAxis(tip.q_WT) * along;
  }));
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_GT(*row.measured, 0.5);
}

TEST(FlippedAxis, forcesThatAreNoNumberAreFound) {
  const CaseRow row = flippedRow(changed(
      [](const TipSample& tip, ForceSource&, StepReport& r) { r.wrench_W.force_N += tip.p_WT_m * 0.0; }));
  EXPECT_FALSE(row.finite);
  EXPECT_EQ(row.verdict, Verdict::kDiverges);
}

// | |u| − 1 | ≤ 1e-12
TEST(FlippedAxis, aDirectionThatIsNoUnitVectorIsFound) {
  class Stretched final : public ForceSource {
   public:
    explicit Stretched(std::unique_ptr<ForceSource> inner) : inner_(std::move(inner)) {}
    void step(const TipSample& tip, StepReport& report) noexcept override { inner_->step(tip, report); }
    [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
      return inner_->axialStiffness_N_per_m();
    }
    [[nodiscard]] Vec3 trajectory() const noexcept override { return inner_->trajectory() * (1 + 5e-12); }

   private:
    std::unique_ptr<ForceSource> inner_;
  };
  const auto stretched = [](const SceneSpec& scene, double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    auto inner = engineSource()(scene, rate_hz);
    if (!inner.ok()) return inner.error();
    return std::unique_ptr<ForceSource>(std::make_unique<Stretched>(std::move(*inner)));
  };
  EXPECT_FALSE(flippedRow(stretched).passed);
}

TEST(FlippedAxis, aForceAboveTheScenesGreatestIsFound) {
  const CaseRow row = flippedRow(changed([](const TipSample&, ForceSource&, StepReport& r) {
    if (norm(r.wrench_W.force_N) > 0.99) r.wrench_W.force_N = r.wrench_W.force_N * 1.02;
  }));
  EXPECT_FALSE(row.passed);
  EXPECT_TRUE(row.finite);
}

// the other models' results in the axial cases, good and bad
TEST(OtherModels, runTheAxialCasesOnly) {
  for (const StabilityCase& one : motionCases()) {
    if (one.name == "flipped_axis") continue;
    const CaseRow row = rowOf(one.name, AxialModel::kDirect);
    const bool about_stops = one.name == "retreat_in_ramp" || one.name == "frozen_device";
    EXPECT_EQ(row.applicable, one.axial && !about_stops) << one.name;
    EXPECT_EQ(row.verdict == Verdict::kNotApplicable, !row.applicable) << one.name;
  }
}

}  // namespace
}  // namespace needlelab::test
