// Planted defects are found by random gestures and shrunk to something that a person understands.
#include "client/sim/stability/passivity_shrink.h"

#include <gtest/gtest.h>

#include "client/sim/stability/gesture_numbers.h"
#include "client/sim/stability/passivity_search.h"
#include "client/sim/stability/round_number.h"
#include "tests/stability/planted_sources.h"

namespace needlelab::test {
namespace {

constexpr AxialModel kShrunkModel = AxialModel::kEnhancedTrackingWall;

// what a shrunk gesture may be at most
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
  // round numbers: two digits or fewer, nearly everywhere
  int long_numbers = 0;
  for (const PassivityStroke& stroke : gesture.strokes)
    for (const double value : {stroke.x_m, stroke.y_m, stroke.depth_m, stroke.tilt_x, stroke.tilt_y})
      long_numbers += significantDigits(value) > 2;
  EXPECT_LE(long_numbers, 2) << text;
}

PassivityFindings found(AxialModel model, const ForceSourceFactory& source, std::string name,
                        const GestureRange& range = {}) {
  PassivitySearch search;
  search.most_counter_examples = 1;
  search.range = range;
  search.source_name = std::move(name);
  auto findings = searchGestures(search, model, source);
  if (findings.ok()) return *std::move(findings);
  ADD_FAILURE() << findings.error().message;
  return {};
}

class PlantedDefect : public testing::TestWithParam<std::size_t> {};
TEST_P(PlantedDefect, isFoundAndShrunk) {
  const auto& [name, defect] = kFindableDefects[GetParam()];
  const auto findings = found(kShrunkModel, referenceSource(defect), sourceName(name));
  ASSERT_GE(findings.failed, 1u);
  const CounterExample& example = findings.counter_examples.front();
  expectSmall(example, {});
  // it fails because of the defect: without it nothing is left
  const auto sound = runGesture(example.gesture, kShrunkModel, referenceSource());
  ASSERT_TRUE(sound.ok()) << sound.error().message;
  EXPECT_FALSE(findingOf(*sound, PassivityLimits{})) << counterExampleJson(example);
}
INSTANTIATE_TEST_SUITE_P(Shrink, PlantedDefect, testing::Range<std::size_t>(0, kFindableDefects.size()));

TEST(Shrink, proportionalClampingIsFoundAndIsTheClampPump) {
  GestureRange range;
  range.clamping = ClampingMode::kProportional;
  const auto findings = found(kShrunkModel, engineSource(), "engine", range);
  ASSERT_GE(findings.failed, 1u);
  const CounterExample& example = findings.counter_examples.front();
  EXPECT_EQ(example.finding.check, PassivityCheck::kEnergy);
  expectSmall(example, {});
  EXPECT_EQ(example.gesture.profile.effects(0), pb::Profile::CLAMPING);
  EXPECT_EQ(example.gesture.profile.effects_size(), 1);
}

TEST(Shrink, directIsFoundToPayBackElsewhere) {
  const auto findings = found(AxialModel::kDirect, engineSource(), "engine");
  ASSERT_GE(findings.failed, 1u);
  expectSmall(findings.counter_examples.front(), {});
}

TEST(Shrink, theShippedEngineHasNothingToShrink) {
  const auto findings = found(kShrunkModel, engineSource(), "engine");
  EXPECT_EQ(findings.failed, 0u);
  for (const auto& example : findings.counter_examples) ADD_FAILURE() << counterExampleJson(example);
}

// what makes a gesture fail is kept to the last, whatever else it is made of
TEST(Shrink, keepsWhatTheFailureNeedsAndNothingElse) {
  const auto deepAndAside = [](const PassivityGesture& gesture) {
    for (const PassivityStroke& stroke : gesture.strokes)
      if (stroke.depth_m > 0.01 && stroke.x_m > 0.005) return true;
    return false;
  };
  int tried = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const PassivityGesture gesture = randomGesture(seed, shapeOf(seed));
    if (!deepAndAside(gesture)) continue;
    ++tried;
    const ShrinkResult result = shrunk(gesture, deepAndAside);
    EXPECT_TRUE(deepAndAside(result.gesture));
    EXPECT_LT(sizeOf(result.gesture), sizeOf(gesture));
    // in, and out again: it must end outside
    EXPECT_LE(result.gesture.strokes.size(), 2u) << seed;
    EXPECT_EQ(result.gesture.profile.effects_size(), 0) << seed;
    EXPECT_EQ(result.gesture.profile.layers_size(), 1) << seed;
    // the same bits again
    EXPECT_EQ(sizeOf(shrunk(gesture, deepAndAside).gesture), sizeOf(result.gesture));
  }
  EXPECT_GE(tried, 10);
}

TEST(Shrink, stopsAtTheGivenNumberOfTries) {
  const PassivityGesture gesture = randomGesture(1, LimbShape::kPlane);
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
