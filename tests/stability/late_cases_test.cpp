// Late and loose devices, each a neighbourhood: what the verdict sees, and what it would overlook.
#include <gtest/gtest.h>

#include <string>

#include "tests/stability/case_rows.h"

namespace needlelab::test {
namespace {

// the case's neighbours but the number `count`, for tests that need fewer
nlohmann::json neighbours(int count, double spread) {
  return {{"count", count},
          {"count_of_other_models", count},
          {"spread", spread},
          {"least_stable", 1},
          {"seed", 1}};
}

class LateCases : public testing::TestWithParam<const char*> {};

// like stations before they measured: one that assumes a delay of one tick and no lag
TEST_P(LateCases, controlAnUnderstatedDelayGivesEnergy) {
  CaseControl control;
  control.uses_measured_delay = false;
  const CaseRow row = rowWithField(GetParam(), "neighbours", neighbours(1, 0), engineSource(), control);
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_LT(*row.passive_margin, 1) << "so the passivity control is on";
}

// as stations rendered it: all of the stiffness, and a tank that an insertion fills
TEST_P(LateCases, controlAllOfTheStiffnessIsNotStable) {
  CaseControl control;
  control.capacity_J = 0.5;
  const CaseRow row = rowWithField(GetParam(), "full_stiffness", true, engineSource(), control);
  EXPECT_FALSE(row.passed) << rowText(row);
}

// a cell is the share of at least 30 neighbours, and they are the same in each run
TEST_P(LateCases, isANeighbourhood) {
  const CaseRow row = rowOf(GetParam());
  ASSERT_TRUE(row.neighbours);
  EXPECT_GE(row.neighbours->all, longForm() ? 200u : 30u);
  EXPECT_DOUBLE_EQ(*row.measured, 1 - row.neighbours->share());
  EXPECT_GT(*row.chatter_N, 0) << "measured in the hold";
  EXPECT_EQ(row.passed, row.neighbours->share() >= 1 - *row.limit - 1e-9) << rowText(row);
}

INSTANTIATE_TEST_SUITE_P(Each, LateCases,
                         testing::Values("lag_2ms", "lag_8ms", "delay_varies", "loose_tap", "grip_changes",
                                         "backlash", "late_rest"),
                         [](const auto& info) { return std::string(info.param); });

// In a tank of 0.5 J the insertion's energy hides the cycle of the rest: since the start the hand has got
// nothing, but each second at rest gives it more.
TEST(LateRest, aCycleIsSeenThoughTheInsertionPaidForIt) {
  CaseControl control;
  control.capacity_J = 0.5;
  const CaseRow row = rowWithField("late_rest", "full_stiffness", true, engineSource(), control);
  EXPECT_EQ(*row.controlled_energy_J, 0) << "since the start";
  EXPECT_GT(*row.second_energy_J, 10e-3);
  EXPECT_GT(*row.hold_swing_N, 0.3);
  EXPECT_EQ(row.verdict, Verdict::kChatters) << rowText(row);
}

// A loop that is not late rests: 0 of 30 give or swing.
TEST(LateRest, aLoopInTimeIsStable) {
  const CaseRow row = rowWithField("late_rest", "plant", {{"delay_ticks", 0}, {"damping_ns_per_m", 3}});
  EXPECT_TRUE(isStable(row));
  EXPECT_GE(row.neighbours->all, 30u);
  EXPECT_LT(*row.second_energy_J, 1e-3);
}

}  // namespace
}  // namespace needlelab::test
