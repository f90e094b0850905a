#include "client/effect_cost/tick_cost.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

TEST(Calibration, namesTheLiveEffectsOnlyEachWithItsCost) {
  SceneSpec scene = paperSixLayers();
  scene.effects |= bitOf(Effect::kShaftFriction);  // listed, but no layer has friction: not live
  const auto costs = calibrateEffects(scene, 1000);
  ASSERT_TRUE(costs.ok()) << costs.error().message;
  ASSERT_EQ(costs->effects.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(costs->effects[i].effect, static_cast<Effect>(i));
  EXPECT_GT(costs->tick_ns, 0);
  for (const EffectCost& cost : costs->effects) EXPECT_TRUE(std::isfinite(cost.ns));
}

TEST(Calibration, aSceneWithoutEffectsHasATickButNoCosts) {
  const auto costs = calibrateEffects(withEffects(paperSixLayers(), 0), 1000);
  ASSERT_TRUE(costs.ok()) << costs.error().message;
  EXPECT_TRUE(costs->effects.empty());
  EXPECT_GT(costs->tick_ns, 0);
}

TEST(Calibration, aSceneThatIsNoSceneIsRefused) {
  SceneSpec scene = paperSixLayers();
  scene.layers.clear();
  EXPECT_FALSE(calibrateEffects(scene, 1000).ok());
}

}  // namespace
}  // namespace needlelab::test
