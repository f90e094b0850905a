// Late and loose devices: the passivity control that is told what was measured leaves the hand no energy;
// told a delay of one tick and no lag, as stations were before they measured, it does not.
#include <gtest/gtest.h>

#include <string>

#include "client/sim/stability/motion_cases.h"
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
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok());
  const auto outcome = lateContact(GetParam(), {*file, longForm()}, AxialModel::kEnhancedTrackingWall,
                                   engineSource(), Told::kOneTick);
  ASSERT_TRUE(outcome.ok()) << outcome.error().message;
  EXPECT_FALSE(outcome->row.passed) << rowText(outcome->row);
}

INSTANTIATE_TEST_SUITE_P(Each, LateCases,
                         testing::Values("lag_2ms", "lag_8ms", "delay_varies", "loose_tap", "grip_changes",
                                         "backlash"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace needlelab::test
