// Checks each axial model with simple numbers that a reader can verify by hand.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <string>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "tests/support/scenes/model_scenes.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

// two layers: 1 N to 10 mm, 2 N below
SceneSpec twoLayers(AxialModel model) {
  SceneSpec scene = paperOneDof();
  scene.layers[0].thickness_m = 0.01;
  scene.layers.push_back(scene.layers[0]);
  scene.layers[1].cutting_force_N = 2.0;
  return likeForLike(scene, model);
}

TEST(ModelsFormula, directIsASpringFromTheSurfaceUpToTheLayersForce) {
  Probe probe(twoLayers(AxialModel::kDirect), 1000);
  probe.at(-0.001);
  EXPECT_DOUBLE_EQ(probe.at(0.001).cutting_N, -0.5);
  EXPECT_DOUBLE_EQ(probe.at(0.005).cutting_N, -1.0) << "the layer's force";
  EXPECT_DOUBLE_EQ(probe.at(0.011).cutting_N, -2.0) << "it steps";
  EXPECT_DOUBLE_EQ(probe.at(0.001).cutting_N, -0.5) << "back the same way: it stores energy";
  SceneSpec endless = twoLayers(AxialModel::kDirect);
  endless.direct.step_at_layers = false;
  Probe deep(endless, 1000);
  deep.at(-0.001);
  EXPECT_DOUBLE_EQ(deep.at(0.012).cutting_N, -6.0);
}

// The slope of the force on an intact membrane at the skin, of 800 N/m, and what the scene says of it.
TEST(ModelsFormula, onAMembraneOnlyModelsThatPassMembranesAddTheirStiffness) {
  for (const AxialModel model : kAllModels) {
    const AxialEntry& entry = axialEntry(model);
    if ((entry.replaces & bitOf(Effect::kPuncture)) != 0) continue;  // its own tops
    SCOPED_TRACE(entry.label);
    SceneSpec scene = paperOneDof();
    scene.layers[0].membrane = MembraneSpec{800, 0, 5};
    scene.effects |= bitOf(Effect::kPuncture);
    Probe probe(renderedBy(scene, model), 1000);
    probe.at(-0.001);
    const std::vector<StepReport> reports = probe.go(200, 0.001);
    const auto pressed_N = [&](std::size_t i) {
      return dot(reports[i].wrench_W.force_N, -probe.site().inward);
    };
    const double slope = (pressed_N(199) - pressed_N(198)) / 1e-5;
    EXPECT_NEAR(slope, 800 + (entry.passes_membranes ? 500 : 0), 1e-6);
    EXPECT_NEAR(alongStiffness(probe.model()).membrane_N_per_m, slope, 1e-6);
  }
}

TEST(ModelsFormula, voigtAddsTheDamperAndNeverPulls) {
  Probe probe(twoLayers(AxialModel::kVoigt), 1000);  // 500 N/m, 5 N·s/m
  probe.at(-0.001);
  EXPECT_NEAR(probe.at(0.0002).cutting_N, -(500 * 0.0002 + 5 * 0.2), 1e-12) << "x = 0 at the tick before";
  EXPECT_NEAR(probe.at(0.0002).cutting_N, -0.1, 1e-12);
  EXPECT_NEAR(probe.at(0.0004).cutting_N, -(0.2 + 1.0), 1e-12);
  EXPECT_EQ(probe.at(0.0001).cutting_N, 0.0) << "outward the damper would pull";
  EXPECT_EQ(probe.last().attracted_N, 0.0);
}

TEST(ModelsFormula, voigtsAdaptiveWindowBridgesNoiseAndShortensAtStarts) {
  SceneSpec scene = twoLayers(AxialModel::kVoigt);
  scene.voigt.velocity_noise_m = 1.1e-5;  // for positions off by 10 µm
  Probe probe(scene, 1000);
  probe.at(-0.001);
  // 20 ticks at rest, each off by half an encoder step: over two ticks the damper alone would give 0.05 N
  for (int i = 0; i < 20; ++i) probe.at(0.002 + (i % 2 == 0 ? 5e-6 : -5e-6));
  EXPECT_NEAR(probe.last().cutting_N, -500 * 0.001995, 1e-9) << "16 ticks ago the needle was where it is";
  // one tick at 0.2 m/s: no longer window fits both the rest and the start
  EXPECT_NEAR(probe.at(0.002195).cutting_N, -(500 * 0.002195 + 5 * 0.2), 1e-9);
  // a straight line is bridged as far as it extends: 16 ticks at 0.01 m/s after the jump
  for (int i = 1; i <= 20; ++i) probe.at(0.002195 + 1e-5 * i);
  EXPECT_NEAR(probe.last().cutting_N, -(500 * 0.002395 + 5 * 0.01), 1e-9);
}

TEST(ModelsFormula, voigtRefusesAnInvalidNoise) {
  SceneSpec scene = twoLayers(AxialModel::kVoigt);
  scene.voigt.velocity_noise_m = -1e-6;
  EXPECT_FALSE(compile(scene, 1000).ok());
}

TEST(ModelsFormula, godObjectHoldsOnEachTopLetsThroughAndIsForcelessBetween) {
  Probe probe(twoLayers(AxialModel::kGodObject), 1000);
  probe.at(-0.001);
  EXPECT_DOUBLE_EQ(probe.at(0.0015).cutting_N, -0.75);
  EXPECT_EQ(norm(probe.last().p_wall_W_m), 0.0) << "the proxy lies on the skin";
  EXPECT_DOUBLE_EQ(probe.at(0.002).cutting_N, -1.0) << "1 N is not exceeded yet";
  const StepReport through = probe.at(0.0021);
  EXPECT_EQ(through.cutting_N, 0.0);
  EXPECT_TRUE(through.flags & kFlagRupture) << "a declared release";
  for (const StepReport& r : probe.go(20, 0.0099)) EXPECT_EQ(r.cutting_N, 0.0);
  EXPECT_NEAR(probe.at(0.013).cutting_N, -500 * 0.003, 1e-12) << "from the second top, at 10 mm";
  EXPECT_NEAR(probe.at(0.0138).cutting_N, -1.9, 1e-12);
  EXPECT_EQ(probe.at(0.008).cutting_N, 0.0) << "above its top it does not pull";
  EXPECT_NEAR(probe.at(0.012).cutting_N, -1.0, 1e-12) << "the second top is where it was";
  EXPECT_EQ(probe.at(0.015).cutting_N, 0.0);
  probe.at(-0.001);
  EXPECT_DOUBLE_EQ(probe.at(0.001).cutting_N, -0.5) << "a new insertion meets the skin again";
}

TEST(ModelsFormula, godObjectMeetsALayerTopPassedEarlierAtItsPlace) {
  SceneSpec scene = twoLayers(AxialModel::kGodObject);
  scene.layers[0].thickness_m = 0.001;  // the second top lies within the first's reach of 2 mm
  Probe probe(scene, 1000);
  probe.at(-0.0005);
  EXPECT_DOUBLE_EQ(probe.at(0.0019).cutting_N, -0.95);
  EXPECT_NEAR(probe.at(0.0021).cutting_N, -500 * 0.0011, 1e-12) << "let through to the top at 1 mm";
}

SceneSpec firstOrderScene() {
  SceneSpec scene = twoLayers(AxialModel::kEnhancedTrackingWall);
  scene.axial_model = AxialModel::kFirstOrder;
  scene.layers[0].first_order = FirstOrderSpec{400, 0.8, 0.3, 20};
  scene.layers[1].first_order = FirstOrderSpec{1000, 0.5, 0.6, 0};
  return scene;
}

TEST(ModelsFormula, firstOrderIsStiffnessThenCuttingAndFriction) {
  Probe probe(firstOrderScene(), 1000);  // K_t 500, K_f 140
  probe.at(-0.001);
  StepReport r = probe.at(0.0015);
  EXPECT_NEAR(r.puncture_N, -0.6, 1e-12);
  EXPECT_EQ(r.cutting_N, 0.0) << "nothing is cut beyond a top that holds";
  EXPECT_EQ(r.friction_N, 0.0);
  r = probe.at(0.0021);  // 0.84 N: ruptured
  EXPECT_TRUE(r.flags & kFlagRupture);
  EXPECT_EQ(r.puncture_N, 0.0);
  EXPECT_EQ(r.cutting_N, 0.0) << "the walls follow: nothing jumps but what was held";
  probe.go(100, 0.008);
  EXPECT_NEAR(probe.last().cutting_N, -0.3, 1e-12);
  EXPECT_NEAR(probe.last().friction_N, -20 * 0.008, 1e-12);
  // the second top, from 10 mm: cutting and friction stay constant while it holds
  r = probe.go(50, 0.0104).back();
  EXPECT_NEAR(r.puncture_N, -1000 * 0.0004, 1e-12);
  EXPECT_NEAR(r.cutting_N, -0.3, 1e-12);
  EXPECT_NEAR(r.friction_N, -20 * 0.010, 1e-12);
  r = probe.go(50, 0.015).back();
  EXPECT_NEAR(r.cutting_N, -0.6, 1e-12);
  EXPECT_NEAR(r.friction_N, -20 * 0.010, 1e-12) << "the second layer does not rub";
  // outward: no cutting; friction reverses
  r = probe.go(100, 0.009).back();
  EXPECT_EQ(r.cutting_N, 0.0);
  EXPECT_NEAR(r.friction_N, 20 * 0.009, 1e-12);
  EXPECT_EQ(r.attracted_N, 0.0);
}

TEST(ModelsFormula, firstOrderRefusesPunctureAndShaftFrictionByName) {
  for (const Effect effect : {Effect::kPuncture, Effect::kShaftFriction}) {
    SceneSpec scene = firstOrderScene();
    scene.effects |= bitOf(effect);
    const auto model = compile(scene, 1000);
    ASSERT_FALSE(model.ok());
    EXPECT_NE(model.error().message.find("effects: lists " + std::string(effectName(effect))),
              std::string::npos)
        << model.error().message;
  }
}

TEST(ModelsFormula, precomputedIsTheTableByTheWall) {
  SceneSpec scene = twoLayers(AxialModel::kEnhancedTrackingWall);
  scene.axial_model = AxialModel::kPrecomputed;
  scene.precomputed.table = {{0.002, 1.0, 0.2}, {0.012, 3.0, 0.6}};
  Probe probe(scene, 1000);
  probe.at(-0.001);
  probe.go(400, 0.007);
  EXPECT_NEAR(probe.last().cutting_N, -2.0, 1e-9) << "half-way between the rows";
  probe.go(400, 0.02);
  EXPECT_NEAR(probe.last().cutting_N, -3.0, 1e-9) << "constant beyond the last";
  probe.go(400, 0.010);
  EXPECT_NEAR(probe.last().attracted_N, 0.2 + 0.4 * 0.8, 1e-9);
  probe.go(200, 0.001);
  EXPECT_NEAR(probe.last().attracted_N, 0.2, 1e-9) << "constant before the first";
}

// The table made from the layers gives the same force as the wall, except within the 10 µm in which a table
// drops.
TEST(LikeForLike, thePrecomputedTableOfTheLayersIsTheWallsForce) {
  const Site site = defaultSite();
  const Motion motion = insertHoldWithdraw(1000, site, site.inward, site.inward, 0.038, 0.02, 0.3);
  EngineRun wall(paperSixLayers(), 1000), table(modelScene(AxialModel::kPrecomputed), 1000);
  int compared = 0;
  for (const TipSample& sample : motion) {
    const StepReport a = wall.step(sample), b = table.step(sample);
    double to_top_m = 1, top_m = 0;
    for (const LayerSpec& layer : paperSixLayers().layers) {
      to_top_m = std::min(to_top_m, std::abs(a.depth_m - top_m));
      top_m += layer.thickness_m;
    }
    if (to_top_m < 3e-5) continue;
    EXPECT_NEAR(a.cutting_N + a.attracted_N, b.cutting_N + b.attracted_N, 1e-9) << a.depth_m;
    ++compared;
  }
  EXPECT_GT(compared, 3000);
}

TEST(LikeForLike, saysWhichOfOkamurasAndDahlsFrictionsAreAssumed) {
  SceneSpec scene = allEffects();
  const OkamuraSpec own = *likeForLike(scene, AxialModel::kOkamura).layers[0].okamura;
  ASSERT_GT(own.in.kinetic_N_per_m, 0);
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  const std::string okamura = frictionAssumption(scene, AxialModel::kOkamura);
  EXPECT_TRUE(has(okamura, "Assumptions") && has(okamura, "not compared with the paper")) << okamura;
  for (const double ratio :
       {own.in.static_N_per_m / own.in.kinetic_N_per_m, own.out.static_N_per_m / own.out.kinetic_N_per_m,
        own.in.viscous_Ns_per_m2 / own.in.kinetic_N_per_m,
        own.out.viscous_Ns_per_m2 / own.out.kinetic_N_per_m})
    EXPECT_TRUE(has(okamura, fmt::format("{:.4g}", ratio))) << ratio << ": " << okamura;
  const std::string dahl = frictionAssumption(scene, AxialModel::kDahl);
  EXPECT_TRUE(has(dahl, "viscous friction of 24.5")) << dahl;
  EXPECT_FALSE(has(dahl, "static")) << "it has none: " << dahl;

  EXPECT_TRUE(has(frictionAssumption(paperSixLayers(), AxialModel::kOkamura), "The scene has no friction"));
  EXPECT_EQ(frictionAssumption(scene, AxialModel::kFirstOrder), "");
  for (LayerSpec& layer : scene.layers) layer.okamura = own;
  EXPECT_EQ(frictionAssumption(scene, AxialModel::kOkamura), "") << "its own numbers";
}

TEST(LikeForLike, everyModelCompilesForEverySceneAndKeepsItsSection) {
  for (const SceneSpec& scene : {paperOneDof(), paperSixLayers(), allEffects()})
    for (const AxialModel model : kAllModels) {
      const auto compiled_scene = compile(renderedBy(scene, model), 1000);
      EXPECT_TRUE(compiled_scene.ok())
          << axialModelName(model) << ": " << (compiled_scene.ok() ? "" : compiled_scene.error().message);
    }
  SceneSpec own = paperSixLayers();
  own.precomputed.table = {{0.01, 1.5, 0.1}};
  own.voigt.stiffness_N_per_m = 333;
  EXPECT_EQ(likeForLike(own, AxialModel::kPrecomputed).precomputed.table.size(), 1u);
  EXPECT_EQ(likeForLike(own, AxialModel::kVoigt).voigt.stiffness_N_per_m, 333);
  own.tracking_wall.stiffness_N_per_m = 800;
  EXPECT_EQ(likeForLike(own, AxialModel::kDirect).direct.stiffness_N_per_m, 800);
  EXPECT_FALSE(likeForLike(allEffects(), AxialModel::kFirstOrder).effects &
               (bitOf(Effect::kPuncture) | bitOf(Effect::kShaftFriction)));
}

}  // namespace
}  // namespace needlelab::test
