// Random gestures: the wall gives the hand nothing and steps nowhere, whatever the gesture.
#include <gtest/gtest.h>

#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/passivity_search.h"
#include "tests/stability/case_rows.h"

namespace needlelab::test {
namespace {

TEST(RandomEnergy, theWallGivesTheHandNothing) {
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok()) << file.error().message;
  const auto outcome = randomEnergy({*file, longForm()}, AxialModel::kEnhancedTrackingWall, engineSource());
  ASSERT_TRUE(outcome.ok()) << outcome.error().message;
  EXPECT_TRUE(outcome->row.passed) << wordsOf(outcome->row);
  EXPECT_LE(*outcome->row.energy_J, 5e-5);
  EXPECT_LE(*outcome->row.max_unexplained_step_N, 0.05);
  // what was found is small by now: keep it in tests/stability/regressions
  for (const CaseAttachment& found : outcome->files) ADD_FAILURE() << found.name << "\n" << found.text;
}

// halving the tick halves a slope and leaves a jump: what is left at 4 kHz is no jump
TEST(RandomEnergy, stepsShrinkWithTheTick) {
  PassivitySearch search;
  search.gestures = 150;
  const auto slow = searchGestures(search, AxialModel::kEnhancedTrackingWall, engineSource());
  search.rate_hz = 4000;
  const auto fast = searchGestures(search, AxialModel::kEnhancedTrackingWall, engineSource());
  ASSERT_TRUE(slow.ok() && fast.ok());
  EXPECT_LE(fast->worst.worst_step_N, 0.5 * slow->worst.worst_step_N);
  EXPECT_LE(judgedEnergy_J(fast->worst), 5e-5);
}

TEST(RandomEnergy, gesturesSeeEverythingThatAnEngineDoes) {
  PassivitySearch search;
  const auto found = searchGestures(search, AxialModel::kEnhancedTrackingWall, engineSource());
  ASSERT_TRUE(found.ok());
  constexpr std::uint32_t kAll = kFlagEntry | kFlagExit | kFlagLayerChange | kFlagRupture | kFlagTurn |
                                 kFlagClampCapped | kFlagTorque | kFlagBeyondNeedle;
  EXPECT_EQ(found->worst.flags & kAll, kAll);
  EXPECT_GE(found->worst.insertions, search.gestures);
}

// which models give energy or step is a finding, not a wish: the table must show it
class EveryModel : public testing::TestWithParam<AxialModel> {};
TEST_P(EveryModel, isJudgedHonestly) {
  const AxialModel model = GetParam();
  const CaseRow row = rowOf("random_energy", model);
  ASSERT_TRUE(row.applicable);
  EXPECT_TRUE(row.finite);
  const bool within = *row.energy_J <= *row.limit && *row.max_unexplained_step_N <= 0.05;
  EXPECT_EQ(row.passed, within) << wordsOf(row);
  EXPECT_EQ(row.verdict, within ? Verdict::kStable : Verdict::kChatters);
  // a damper's force jumps with the speed; a force that depends on place alone pays back what it took
  // elsewhere
  if (model == AxialModel::kVoigt) {
    EXPECT_GT(*row.max_unexplained_step_N, 0.05);
  }
  if (model == AxialModel::kDirect) {
    EXPECT_GT(*row.energy_J, 1e-3);
  }
  if (model == AxialModel::kTrackingWall) {
    EXPECT_TRUE(row.passed) << wordsOf(row);
  }
}
INSTANTIATE_TEST_SUITE_P(RandomEnergy, EveryModel,
                         testing::Values(AxialModel::kTrackingWall, AxialModel::kDirect, AxialModel::kVoigt,
                                         AxialModel::kGodObject, AxialModel::kFirstOrder,
                                         AxialModel::kStatistical, AxialModel::kPrecomputed),
                         [](const auto& test) { return std::string(axialModelName(test.param)); });

}  // namespace
}  // namespace needlelab::test
