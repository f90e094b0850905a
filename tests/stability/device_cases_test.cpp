// Faults of a device or its clock: the wall passes each case, and a control fails it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "tests/stability/case_rows.h"
#include "tests/stability/changed_source.h"

namespace needlelab::test {
namespace {

constexpr AxialModel kShipped = AxialModel::kEnhancedTrackingWall;

// every model has a row in every case, good or bad; an FEM mesh takes a second, so it is skipped here
TEST(DeviceCases, everyModelHasAFiniteRow) {
  for (const StabilityCase& one : deviceCases())
    for (const AxialModel model :
         {AxialModel::kTrackingWall, AxialModel::kDirect, AxialModel::kVoigt, AxialModel::kGodObject,
          AxialModel::kFirstOrder, AxialModel::kStatistical, AxialModel::kPrecomputed}) {
      const CaseRow row = rowOf(one.name, model);
      EXPECT_TRUE(row.applicable && row.finite) << one.name << ", " << axialModelName(model);
      EXPECT_TRUE(row.measured && row.limit) << one.name << ", " << axialModelName(model);
    }
}

TEST(GlitchUnderGate, aSpringWithoutEndDepartsByMoreThanTissueCan) {
  const auto spring = [](SceneSpec scene, double rate_hz) {
    scene.axial_model = AxialModel::kDirect;
    scene.direct = {scene.tracking_wall.stiffness_N_per_m, false};
    return engineSource()(scene, rate_hz);
  };
  const CaseRow row = rowOf("glitch_under_gate", kShipped, spring);
  EXPECT_FALSE(row.passed) << rowText(row);
  // K · 4.9 mm; the gate lets 2 N of it through in the tick
  EXPECT_NEAR(*row.measured, 2.0, 0.1) << rowText(row);
}

// 5 m/s over a tick of 1 ms are 5 mm; on the way in or out 0.02 mm belong to the needle's own motion
TEST(GlitchUnderGate, theGateRejectsALargerOne) {
  const CaseRow under = rowOf("glitch_under_gate"),
                over = rowWithField("glitch_under_gate", "glitch_m", 0.0051);
  EXPECT_GT(*under.measured, 0.5) << "the wall follows it";
  EXPECT_LT(*over.measured, 0.03) << "the held force of one tick";
}

// a source that treats a jump as a new zero, like a clutched device, is off by it until the needle is out
TEST(FrozenAxis, aJumpTakenForANewZeroFails) {
  class NewZero final : public ForceSource {
   public:
    explicit NewZero(std::unique_ptr<ForceSource> inner) : inner_(std::move(inner)) {}
    void step(const TipSample& tip, StepReport& report) noexcept override {
      const Vec3 way = tip.p_WT_m - before_W_m_;
      before_W_m_ = tip.p_WT_m;
      if (begun_ && norm(way) > 1e-3) offset_W_m_ += way;
      begun_ = true;
      inner_->step({tip.p_WT_m - offset_W_m_, tip.q_WT}, report);
    }
    [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
      return inner_->axialStiffness_N_per_m();
    }

   private:
    std::unique_ptr<ForceSource> inner_;
    Vec3 before_W_m_, offset_W_m_;
    bool begun_ = false;
  };
  const auto source = [](const SceneSpec& scene, double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    auto inner = engineSource()(scene, rate_hz);
    if (!inner.ok()) return inner.error();
    return std::unique_ptr<ForceSource>(std::make_unique<NewZero>(std::move(*inner)));
  };
  const CaseRow row = rowOf("frozen_axis", kShipped, source);
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_GT(*row.measured, 0.1) << rowText(row);
}

// an angle from the scalar part alone: 2·acos(w) of −q turns the other way round
TEST(QuaternionSign, aTorqueFromTheScalarPartAloneFails) {
  const CaseRow row =
      rowOf("quaternion_sign", kShipped, changed([](const TipSample& tip, ForceSource&, StepReport& r) {
              const Vec3 vector{tip.q_WT.x, tip.q_WT.y, tip.q_WT.z};
              r.wrench_W.torque_Nm += vector * (0.01 * std::acos(std::clamp(tip.q_WT.w, -1.0, 1.0)));
            }));
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_GT(*row.measured, 1e-3) << rowText(row);
}

}  // namespace
}  // namespace needlelab::test
