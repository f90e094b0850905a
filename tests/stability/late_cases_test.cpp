// Late and loose devices: a passivity control that knows the measured values leaves the hand no energy
// (EveryCase); one that assumes a delay of one tick and no lag, like stations before they measured, does not.
#include <gtest/gtest.h>

#include <string>

#include "tests/stability/case_rows.h"

namespace needlelab::test {
namespace {

class LateCases : public testing::TestWithParam<const char*> {};

TEST_P(LateCases, controlAnUnderstatedDelayGivesEnergy) {
  CaseControl control;
  control.uses_measured_delay = false;
  const CaseRow row = rowOf(GetParam(), AxialModel::kEnhancedTrackingWall, engineSource(), control);
  EXPECT_FALSE(row.passed) << rowText(row);
  EXPECT_LT(*row.passive_margin, 1) << "so the passivity control is on";
}

INSTANTIATE_TEST_SUITE_P(Each, LateCases,
                         testing::Values("lag_2ms", "lag_8ms", "delay_varies", "loose_tap", "grip_changes",
                                         "backlash"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace needlelab::test
