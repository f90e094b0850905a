// Late and loose devices: the passivity control that is told what was measured leaves the hand no energy;
// told a delay of one tick and no lag, as stations were before they measured, it does not.
#include <gtest/gtest.h>

#include <string>

#include "tests/stability/case_rows.h"

namespace needlelab::test {
namespace {

class LateCases : public testing::TestWithParam<const char*> {};

TEST_P(LateCases, theHandGetsNoEnergy) {
  const CaseRow row = rowOf(GetParam());
  EXPECT_EQ(row.verdict, Verdict::kStable) << rowText(row);
  EXPECT_LT(*row.passive_margin, 1) << "so the passivity control is on";
}

TEST_P(LateCases, controlToldOneTickItGetsSome) {
  CaseControl control;
  control.told_as_measured = false;
  const CaseRow row = rowOf(GetParam(), AxialModel::kEnhancedTrackingWall, engineSource(), control);
  EXPECT_FALSE(row.passed) << rowText(row);
}

INSTANTIATE_TEST_SUITE_P(Each, LateCases,
                         testing::Values("lag_2ms", "lag_8ms", "delay_varies", "loose_tap", "grip_changes",
                                         "backlash"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace needlelab::test
