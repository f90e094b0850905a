// Random gestures: the wall never gives energy to the hand and never steps.
#include <gtest/gtest.h>

#include <cstdio>

#include "client/sim/stability/gestures/passivity_gesture.h"
#include "client/sim/stability/gestures/passivity_observer.h"
#include "tests/stability/case_rows.h"
#include "tests/stability/planted_sources.h"
#include "tests/stability/search/counter_example.h"
#include "tests/stability/search/shrink.h"

namespace needlelab::test {
namespace {

TEST(RandomEnergy, theWallGivesTheHandNothing) {
  const CaseRow row = rowOf("random_energy");
  std::printf("the enhanced tracking wall: worst %.4f mJ, step %.4f N\n", 1e3 * *row.energy_J,
              *row.max_unexplained_step_N);
  EXPECT_TRUE(row.passed) << rowText(row);
  EXPECT_LE(*row.energy_J, 5e-5);
  EXPECT_LE(*row.max_unexplained_step_N, 0.05);
}

// a seed's motion and its scene without the stages do not change with them, so that kept seeds keep their
// meaning; and each stage is drawn
TEST(RandomEnergy, drawingStagesDoesNotChangeTheOtherDraws) {
  GestureRange with;
  with.stages = true;
  int cut = 0, bones = 0, slanting = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const PassivityGesture plain = randomGesture(seed);
    const PassivityGesture staged = randomGesture(seed, with);
    for (const int effect : staged.profile.effects()) {
      cut += effect == pb::Profile::CUT_MEMORY;
      bones += effect == pb::Profile::BONE;
    }
    slanting += staged.profile.bone().has_normal();
    const auto samples = samplesOf(plain), same = samplesOf(staged);
    ASSERT_EQ(samples.size(), same.size()) << seed;
    EXPECT_EQ(samples.back().p_WT_m, same.back().p_WT_m) << seed;
    EXPECT_EQ(plain.profile.tracking_wall().SerializeAsString(),
              staged.profile.tracking_wall().SerializeAsString());
    for (const int effect : plain.profile.effects())
      EXPECT_LE(effect, static_cast<int>(kPlacedEffectCount)) << "no stage unless asked for";
  }
  EXPECT_GT(cut, 20);
  EXPECT_GT(bones, 30);
  EXPECT_GT(slanting, 8);
}

// halving the tick halves a slope but not a jump: a step that shrinks at 4 kHz is not a jump
TEST(RandomEnergy, stepsShrinkWithTheTick) {
  GestureSearch search;
  search.gestures = 150;
  const auto slow = searchGestures(search, AxialModel::kEnhancedTrackingWall, engineSource());
  search.rate_hz = 4000;
  const auto fast = searchGestures(search, AxialModel::kEnhancedTrackingWall, engineSource());
  ASSERT_TRUE(slow.ok() && fast.ok());
  EXPECT_LE(fast->worst.worst_step_N, 0.5 * slow->worst.worst_step_N);
  EXPECT_LE(judgedEnergy_J(fast->worst), 5e-5);
}

TEST(RandomEnergy, gesturesSeeEverythingThatAnEngineDoes) {
  GestureSearch search;
  const auto found = searchGestures(search, AxialModel::kEnhancedTrackingWall, engineSource());
  ASSERT_TRUE(found.ok());
  constexpr std::uint32_t kAll = kFlagEntry | kFlagExit | kFlagLayerChange | kFlagRupture | kFlagTurn |
                                 kFlagClampCapped | kFlagTorque | kFlagBeyondNeedle;
  EXPECT_EQ(found->worst.flags & kAll, kAll);
  EXPECT_GE(found->worst.insertions, search.gestures);
}

// the table must show which models give energy or have steps
class EveryModel : public testing::TestWithParam<AxialModel> {};
TEST_P(EveryModel, isJudgedHonestly) {
  const AxialModel model = GetParam();
  const CaseRow row = rowOf("random_energy", model);
  ASSERT_TRUE(row.applicable);
  EXPECT_TRUE(row.finite);
  const bool within = *row.energy_J <= *row.limit && *row.max_unexplained_step_N <= 0.05;
  EXPECT_EQ(row.passed, within) << rowText(row);
  EXPECT_EQ(row.verdict, within ? Verdict::kStable : Verdict::kChatters);
  // a damper's force jumps with the speed; a force that depends only on position returns what it took
  // elsewhere
  if (model == AxialModel::kVoigt) {
    EXPECT_GT(*row.max_unexplained_step_N, 0.05);
  }
  if (model == AxialModel::kDirect) {
    EXPECT_GT(*row.energy_J, 1e-3);
  }
  if (model == AxialModel::kTrackingWall) {
    EXPECT_TRUE(row.passed) << rowText(row);
  }
}
INSTANTIATE_TEST_SUITE_P(RandomEnergy, EveryModel,
                         testing::Values(AxialModel::kTrackingWall, AxialModel::kDirect, AxialModel::kVoigt,
                                         AxialModel::kGodObject, AxialModel::kFirstOrder,
                                         AxialModel::kStatistical, AxialModel::kPrecomputed,
                                         AxialModel::kOkamura, AxialModel::kDahl),
                         [](const auto& test) { return std::string(axialModelName(test.param)); });

}  // namespace

namespace {

constexpr AxialModel kShrunkModel = AxialModel::kEnhancedTrackingWall;

// maximum size of a shrunk gesture
struct Small {
  std::size_t strokes = 4;
  int effects = 2, layers = 2;
};

void expectSmall(const CounterExample& example, const Small& most) {
  const PassivityGesture& gesture = example.gesture;
  const std::string text = counterExampleJson(example);
  EXPECT_LE(gesture.strokes.size(), most.strokes) << text;
  EXPECT_LE(gesture.profile.effects_size(), most.effects) << text;
  EXPECT_LE(gesture.profile.layers_size(), most.layers) << text;
  EXPECT_EQ(gesture.tremor_m, 0) << text;
  EXPECT_EQ(gesture.encoder_step_m, 0) << text;
  // round numbers: at most two digits, with few exceptions
  int long_numbers = 0;
  for (const PassivityStroke& stroke : gesture.strokes)
    for (const double value : {stroke.x_m, stroke.y_m, stroke.depth_m, stroke.tilt_x, stroke.tilt_y})
      long_numbers += significantDigits(value) > 2;
  EXPECT_LE(long_numbers, 4) << text;
}

std::vector<CounterExample> found(AxialModel model, const ForceSourceFactory& source, const std::string& name,
                                  const GestureRange& range = {}) {
  GestureSearch search;
  search.range = range;
  auto examples = counterExamples(search, name, model, source);
  if (examples.ok()) return *std::move(examples);
  ADD_FAILURE() << examples.error().message;
  return {};
}

class PlantedDefect : public testing::TestWithParam<std::size_t> {};
TEST_P(PlantedDefect, isFoundAndShrunk) {
  const auto& [name, defect] = kFindableDefects[GetParam()];
  const auto examples = found(kShrunkModel, referenceSource(defect), sourceName(name));
  ASSERT_FALSE(examples.empty());
  const CounterExample& example = examples.front();
  expectSmall(example, {});
  // the defect causes the failure: without it the gesture passes
  const auto sound = runGesture(example.gesture, kShrunkModel, referenceSource());
  ASSERT_TRUE(sound.ok()) << sound.error().message;
  EXPECT_FALSE(findingOf(*sound, PassivityLimits{})) << counterExampleJson(example);
}
INSTANTIATE_TEST_SUITE_P(Shrink, PlantedDefect, testing::Range<std::size_t>(0, kFindableDefects.size()));

TEST(Shrink, proportionalClampingIsFoundAndIsTheClampPump) {
  GestureRange range;
  range.clamping = ClampingMode::kProportional;
  const auto examples = found(kShrunkModel, engineSource(), "engine", range);
  ASSERT_FALSE(examples.empty());
  const CounterExample& example = examples.front();
  EXPECT_EQ(example.finding.check, PassivityCheck::kEnergy);
  expectSmall(example, {});
  EXPECT_EQ(example.gesture.profile.effects(0), pb::Profile::CLAMPING);
  EXPECT_EQ(example.gesture.profile.effects_size(), 1);
}

TEST(Shrink, directIsFoundToPayBackElsewhere) {
  const auto examples = found(AxialModel::kDirect, engineSource(), "engine");
  ASSERT_FALSE(examples.empty());
  expectSmall(examples.front(), {});
}

// shrinking keeps the cause of the failure and drops everything else
TEST(Shrink, keepsWhatTheFailureNeedsAndNothingElse) {
  const auto deepAndAside = [](const PassivityGesture& gesture) {
    for (const PassivityStroke& stroke : gesture.strokes)
      if (stroke.depth_m > 0.01 && stroke.x_m > 0.005) return true;
    return false;
  };
  int tried = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const PassivityGesture gesture = randomGesture(seed);
    if (!deepAndAside(gesture)) continue;
    ++tried;
    const ShrinkResult result = shrunk(gesture, deepAndAside);
    EXPECT_TRUE(deepAndAside(result.gesture));
    EXPECT_LT(sizeOf(result.gesture), sizeOf(gesture));
    // in and out again: it must end outside
    EXPECT_LE(result.gesture.strokes.size(), 2u) << seed;
    EXPECT_EQ(result.gesture.profile.effects_size(), 0) << seed;
    EXPECT_EQ(result.gesture.profile.layers_size(), 1) << seed;
    // the same bits again
    EXPECT_EQ(sizeOf(shrunk(gesture, deepAndAside).gesture), sizeOf(result.gesture));
  }
  EXPECT_GE(tried, 10);
}

TEST(Shrink, stopsAtTheGivenNumberOfTries) {
  const PassivityGesture gesture = randomGesture(1);
  std::size_t asked = 0;
  const auto always = [&](const PassivityGesture&) {
    ++asked;
    return true;
  };
  const ShrinkResult result = shrunk(gesture, always, 7);
  EXPECT_EQ(result.tried, 7u);
  EXPECT_EQ(asked, 7u);
}

}  // namespace

}  // namespace needlelab::test
