// The cases of the needle's line: the engine and the reference pass each, and its defect fails.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/haptics/gate/force_gate.h"
#include "tests/stability/case_rows.h"

namespace needlelab::test {
namespace {

class LineStands : public testing::TestWithParam<std::string> {};
TEST_P(LineStands, withTheReference) {
  const CaseRow row = rowWith(Defect::kNone, GetParam());
  EXPECT_TRUE(row.passed) << rowText(row);
}
INSTANTIATE_TEST_SUITE_P(
    Line, LineStands,
    [] {
      std::vector<std::string> names;
      for (const StabilityCase& one : lineCases()) names.push_back(one.name);
      return testing::ValuesIn(names);
    }(),
    [](const auto& test) { return test.param; });

struct LineControl {
  const char* name;
  Defect defect;
  double at_least;  // times the limit
};
class LineDefectFails : public testing::TestWithParam<LineControl> {};
TEST_P(LineDefectFails, theSameCheck) {
  const auto [name, defect, at_least] = GetParam();
  const CaseRow row = rowWith(defect, name);
  EXPECT_FALSE(row.passed) << rowText(row);
  ASSERT_TRUE(row.measured && row.limit);
  EXPECT_GE(*row.measured, at_least * *row.limit) << rowText(row);
}
INSTANTIATE_TEST_SUITE_P(Line, LineDefectFails,
                         testing::Values(LineControl{"held_fixture", Defect::kFixtureForgets, 50},
                                         LineControl{"crosswise", Defect::kLengthAlongU, 4},
                                         LineControl{"round_limb_length", Defect::kLengthAlongU, 10},
                                         LineControl{"re_aim", Defect::kTurnsOnlyDeep, 10},
                                         LineControl{"aside_then_deep", Defect::kFixtureForgets, 50},
                                         LineControl{"run_through", Defect::kExitAnywhere, 1},
                                         LineControl{"eighty_degrees", Defect::kEntryJumpsAt80, 10}),
                         [](const auto& test) { return std::string(test.param.name); });

// the other half of re_aim: what follows the hand near the skin must not follow it when deep
TEST(ReAim, aTrajectoryThatTurnsAtNothingFails) {
  const CaseRow row = rowWith(Defect::kTurnsFreely, "re_aim");
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_NE(row.note.find("not so: the page's angle"), std::string::npos) << row.note;
}

// like an earlier gate: force and torque each with their own share, which rises in contact
WrenchLimiter separateShares(double rate_hz) {
  struct Part {
    double peak;
    ThermalBudget budget;
    Vec3 limited(Vec3 v) {
      const double wanted = std::min(norm(v), peak), size = std::min(wanted, budget.allowed(wanted));
      budget.spend(size);
      return wanted > 0 ? v * (size / norm(v)) : v;
    }
  };
  const DeviceLimits limits;
  Part force{limits.peak_force_N, {limits.peak_force_N, limits.continuous_force_N, 1 / rate_hz}};
  Part torque{limits.peak_torque_Nm, {limits.peak_torque_Nm, limits.continuous_torque_Nm, 1 / rate_hz}};
  return [force, torque](const TipSample&, const Wrench& wanted) mutable {
    return Wrench{force.limited(wanted.force_N), torque.limited(wanted.torque_Nm)};
  };
}

TEST(LeaningOnTool, separateSharesOfForceAndTorquePayTheHand) {
  CaseControl control;
  control.limiter = separateShares;
  const CaseRow row = rowOf("leaning_on_tool", AxialModel::kEnhancedTrackingWall, engineSource(), control);
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_GE(*row.measured, 1e-3) << rowText(row);
}

// eq. 8 alone is not conservative: the same loops give the hand energy where no cap binds
TEST(CapOnSum, proportionalPaysTheHandWithoutACap) {
  const CaseRow row =
      rowOf("cap_on_sum", AxialModel::kEnhancedTrackingWall, [](SceneSpec scene, double rate_hz) {
        scene.virtual_fixture.mode = ClampingMode::kProportional;
        return engineSource()(scene, rate_hz);
      });
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_GE(*row.measured, 500 * *row.limit) << rowText(row);
}

}  // namespace
}  // namespace needlelab::test
