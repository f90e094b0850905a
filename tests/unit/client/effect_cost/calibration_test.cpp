#include "client/effect_cost/calibration.h"

#include <gtest/gtest.h>

#include "common/base/clock.h"
#include "tests/support/scenes.h"

namespace needlelab::test {
namespace {

TEST(Calibration, namesTheLiveEffectsOnlyEachWithItsCost) {
  SceneSpec scene = paperSixLayers();
  scene.effects |= bitOf(Effect::kShaftFriction);  // listed, but no layer has friction: not live
  const auto costs = calibrateEffects(scene, 1000);
  ASSERT_TRUE(costs.ok()) << costs.error().message;
  ASSERT_EQ(costs->effects.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(costs->effects[i].effect, static_cast<Effect>(i));
  EXPECT_GT(costs->tick_ns, 1);
  for (const EffectCost& cost : costs->effects) EXPECT_LT(cost.ns, costs->tick_ns);
}

TEST(Calibration, aSceneWithoutEffectsHasATickButNoCosts) {
  const auto costs = calibrateEffects(withEffects(paperSixLayers(), 0), 1000);
  ASSERT_TRUE(costs.ok()) << costs.error().message;
  EXPECT_TRUE(costs->effects.empty());
  EXPECT_GT(costs->tick_ns, 0);
}

// Clamping follows a line and computes an integral, a square root and a division, so its cost is clearly
// above zero. On a busy machine a single calibration can be wrong, so the test takes the best of several.
TEST(Calibration, clampingCostsSomething) {
  double most_ns = 0;
  for (int i = 0; i < 5; ++i) {
    const auto costs = calibrateEffects(allEffects(), 1000, 0.02);
    ASSERT_TRUE(costs.ok());
    for (const EffectCost& cost : costs->effects)
      if (cost.effect == Effect::kClamping) most_ns = std::max(most_ns, cost.ns);
  }
  EXPECT_GT(most_ns, 0.3);
}

TEST(Calibration, takesLessThanATenthOfASecond) {
  std::int64_t least_ns = 1'000'000'000;
  for (int i = 0; i < 3; ++i) {
    const std::int64_t from_ns = steadyNowNs();
    ASSERT_TRUE(calibrateEffects(allEffects(), 1000).ok());
    least_ns = std::min(least_ns, steadyNowNs() - from_ns);
  }
  EXPECT_LT(least_ns, 100'000'000);
}

TEST(Calibration, aSceneThatIsNoSceneIsRefused) {
  SceneSpec scene = paperSixLayers();
  scene.layers.clear();
  EXPECT_FALSE(calibrateEffects(scene, 1000).ok());
}

}  // namespace
}  // namespace needlelab::test
