// Membranes (FORCE_MODEL.md, "Puncture") by formula.
#include <gtest/gtest.h>

#include <cmath>

#include "common/haptics/effects/effect_entry.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr EffectMask kPuncture = bitOf(Effect::kPuncture);

// two layers, of 10 mm and unlimited; membranes on the given tops
SceneSpec membraneScene(std::optional<MembraneSpec> skin, std::optional<MembraneSpec> inner,
                        EffectMask effects = kPuncture) {
  SceneSpec scene = oneLayer(1.0, 0.5, 0.1);
  scene.layers.push_back(scene.layers[0]);
  scene.layers[0].thickness_m = 0.01;
  scene.layers[0].membrane = skin;
  scene.layers[1].membrane = inner;
  scene.effects = effects;
  return scene;
}

TEST(Puncture, forceFollowsItsCurveUntilItRupturesAndThatTickHasNone) {
  const MembraneSpec skin{200, 20'000, 0.6};
  Probe probe(membraneScene(skin, {}), 1000);
  probe.at(-1e-4);
  int ruptures = 0;
  for (int i = 1; i <= 400; ++i) {
    const double z = 1e-5 * i, expected = 200 * z + 20'000 * z * z;
    const StepReport report = probe.at(z);
    const bool broken = expected >= 0.6;
    ASSERT_NEAR(report.puncture_N, broken ? 0.0 : -expected, 1e-9) << i;
    ruptures += (report.flags & kFlagRupture) != 0;
    if (report.flags & kFlagRupture) {
      ASSERT_LT(200 * (z - 1e-5) + 20'000 * (z - 1e-5) * (z - 1e-5), 0.6);
    }
  }
  EXPECT_EQ(ruptures, 1);
}

TEST(Puncture, staysRupturedInThisInsertionAndIsWholeInTheNext) {
  Probe probe(membraneScene(MembraneSpec{200, 0, 0.2}, {}), 1000);
  probe.at(-1e-4);
  probe.go(100, 0.005);
  probe.go(100, 0.0001);
  for (const auto& report : probe.go(100, 0.005)) ASSERT_EQ(report.puncture_N, 0.0);
  probe.go(100, -0.001);
  EXPECT_NEAR(probe.go(100, 0.0005).back().puncture_N, -0.1, 1e-9);
}

TEST(Puncture, pullingBackFromAMembraneReleasesItAsASpring) {
  Probe probe(membraneScene(MembraneSpec{200, 0, 2}, {}), 1000);
  probe.at(-1e-4);
  probe.go(100, 0.005);
  for (const auto& report : probe.go(50, 0.001)) ASSERT_NEAR(report.puncture_N, -200 * report.depth_m, 1e-9);
}

TEST(Puncture, itsPlaceIsWhereTheDepthIsItsTopBetweenTwoTicks) {
  // the inner membrane's top is at 10 mm; ticks of 3 mm jump over it
  Probe probe(membraneScene({}, MembraneSpec{100, 0, 5}), 1000);
  probe.at(-0.001);
  for (int i = 1; i <= 7; ++i) {
    const double x = 0.003 * i - 0.001;
    ASSERT_NEAR(probe.at(x).puncture_N, -100 * std::max(0.0, x - 0.01), 1e-9);
  }
  // oblique: along u the membrane is thickness/c deep
  const double tangent = 0.75, c = 0.8;
  const Vec3 axis = tilted({0, 0, -1}, tangent, {1, 0, 0});
  EngineRun run(membraneScene({}, MembraneSpec{100, 0, 5}), 1000);
  for (const auto& sample : insertHoldWithdraw(1000, defaultSite(), axis, axis, 0.03, 0.02, 0.01)) {
    const StepReport report = run.step(sample);
    const double x = -sample.p_WT_m.z / c;
    ASSERT_NEAR(report.puncture_N, -100 * std::max(0.0, x - 0.01 / c), 1e-9);
  }
}

TEST(Puncture, anEntryTickThatGoesDeepMeetsMembranesFromTheEntryPoint) {
  Probe probe(membraneScene(MembraneSpec{10, 0, 5}, MembraneSpec{100, 0, 5}), 1000);
  probe.at(-0.005);
  const StepReport report = probe.at(0.015);  // one tick through both tops
  EXPECT_NEAR(report.puncture_N, -(10 * 0.015 + 100 * 0.005), 1e-9) << "membranes add";
}

// "Nothing is cut or rubbed beyond a membrane that holds"
TEST(Puncture, wallsStopAtAMembraneAndFollowItsRuptureSmoothly) {
  SceneSpec scene =
      membraneScene({}, MembraneSpec{200, 0, 0.6}, kPuncture | kAxial | bitOf(Effect::kShaftFriction));
  for (auto& layer : scene.layers) layer.friction_N_per_m = 20;
  Probe probe(scene, 1000);
  probe.at(-0.001);
  probe.go(400, 0.0095);
  ASSERT_NEAR(probe.last().cutting_N, -1.0, 1e-9);
  StepReport before = probe.last();
  bool ruptured = false;
  for (int i = 1; i <= 400; ++i) {
    const double x = 0.0095 + 1e-5 * i;
    const StepReport report = probe.at(x);
    if (!ruptured && !(report.flags & kFlagRupture) && x > 0.01) {
      ASSERT_NEAR(report.cutting_N, -1.0, 1e-9) << "as at the membrane's place";
      ASSERT_NEAR(report.puncture_N, -200 * (x - 0.01), 1e-9);
    }
    if (report.flags & kFlagRupture) {
      ruptured = true;
      EXPECT_NEAR(report.cutting_N, before.cutting_N, 1e-9) << "the wall's own force does not jump";
      EXPECT_LE(std::abs(report.friction_N - before.friction_N), 140 * 1e-5);
      EXPECT_NEAR(report.puncture_N - before.puncture_N, 0.6, 200 * 1.1e-5)
          << "only the membrane's is released";
    }
    before = report;
  }
  EXPECT_TRUE(ruptured);
}

TEST(Puncture, beforeTheSkinBreaksThereIsNoCuttingForce) {
  SceneSpec scene = membraneScene(MembraneSpec{200, 20'000, 0.6}, {}, kPuncture | kAxial);
  Probe probe(scene, 1000);
  probe.at(-1e-5);
  for (int i = 1; i <= 150; ++i) ASSERT_EQ(probe.at(1e-5 * i).cutting_N, 0.0);
  probe.go(300, 0.009);
  EXPECT_NEAR(probe.last().cutting_N, -1.0, 1e-9);
}

// At 45° just under the skin: 3 mm forward ruptured it, and 5 mm backward left its membrane in the fat.
TEST(Puncture, aMembraneStaysWithTheSkinUnderWhichANeedleSlides) {
  SceneSpec scene = withEffects(oneLayer(1, 0.3, 0.1), bitOf(Effect::kPuncture) | kAxial);
  scene.layers[0].membrane = MembraneSpec{200, 20'000, 0.6};
  const Vec3 axis = tilted({0, 0, -1}, 1, {1, 0, 0});
  for (const double slide_m : {0.003, -0.005}) {
    EngineRun run(scene, 1000);
    MotionBuilder path(1000, axis * -0.002, axis);
    path.slideTo(axis * 0.0005, 0.01).slideTo(axis * 0.0005 + Vec3{slide_m, 0, 0}, 0.01);
    for (const TipSample& sample : path.samples())
      ASSERT_FALSE(run.step(sample).flags & kFlagRupture) << slide_m;
    ASSERT_EQ(run.state().membranes_met, 1u);
    // pressed on along the needle it ruptures where 0.6 N say, from the skin or at most from where it is now
    double ruptured_m = 0;
    Vec3 tip = path.samples().back().p_WT_m;
    for (int k = 0; k < 1000 && ruptured_m == 0; ++k) {
      tip = tip + axis * 1e-5;
      const StepReport report = run.step({tip, pointing(axis)});
      if (report.flags & kFlagRupture) ruptured_m = report.depth_m / -axis.z;
    }
    const double stretch_m = (-200 + std::sqrt(200 * 200 + 4 * 20'000 * 0.6)) / (2 * 20'000);
    EXPECT_GE(ruptured_m, stretch_m - 2e-5) << slide_m;
    EXPECT_LE(ruptured_m, stretch_m + 0.0005 + 2e-5) << slide_m;
  }
}

// 10 mm aside at 0.2 mm was a new hole for nothing
TEST(Puncture, aNewHoleIsAPuncture) {
  SceneSpec scene = withEffects(allEffects(), kPlacedEffects);
  scene.layers[0].membrane = MembraneSpec{200, 20'000, 0.6};
  for (const bool remembers : {false, true}) {
    if (remembers) {
      scene.effects |= bitOf(Effect::kCutMemory);
      useUsualNumbers(effectEntry(Effect::kCutMemory), scene);
    }
    for (const double aside_m : {0.0, 0.0008, 0.003, 0.01}) {
      Probe probe(scene, 1000);
      probe.at(-1e-4);
      probe.go(300, 0.006);
      probe.go(300, 0.0002);
      probe.go(600, 0.0002, aside_m);
      int ruptures = 0;
      for (const StepReport& report : probe.go(300, 0.006, aside_m))
        if (report.flags & kFlagRupture) ++ruptures;
      EXPECT_EQ(ruptures, aside_m > 0.001 ? 1 : 0) << aside_m << (remembers ? ", with CUT_MEMORY" : "");
    }
  }
}

}  // namespace
}  // namespace needlelab::test
