// The engine compared with its literal transcription (tests/support/reference/reference_engine.h): every set
// of effects, every limb, both clamping modes, both stop modes, many rates; to 1e-9 N and 1e-9 N·m at every
// tick.
#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {
namespace {

SceneSpec variant(EffectMask effects, LimbKind limb, ClampingMode clamping, StopMode stop, bool hub) {
  SceneSpec scene = withEffects(withLimb(allEffects(), limb), effects);
  scene.virtual_fixture.mode = clamping;
  scene.virtual_fixture.max_force_N = 2.0;  // low, so that the trajectory does change
  scene.tracking_wall.stop_mode = stop;
  scene.tracking_wall.stop_duration_s = 0.3;
  scene.tracking_wall.relax_time_s = 0.2;
  if (hub) {
    scene.effects |= bitOf(Effect::kHub);
    scene.stage_numbers[stageOf(Effect::kHub)][kHubStiffness_N_per_m] = 300;
    scene.needle_length_m = 0.02;
  }
  return scene;
}

std::string named(EffectMask effects, LimbKind limb, ClampingMode clamping, StopMode stop, double rate_hz,
                  std::uint64_t seed) {
  return "effects mask " + std::to_string(effects) + ", " + std::string(limbName(limb)) +
         (clamping == ClampingMode::kConservative ? ", CONSERVATIVE" : ", PROPORTIONAL") +
         (stop == StopMode::kRamp ? ", RAMP, " : ", EXPONENTIAL, ") + std::to_string(rate_hz) + " Hz, seed " +
         std::to_string(seed);
}

struct ReferencePerLimb : ::testing::TestWithParam<LimbKind> {};

TEST_P(ReferencePerLimb, everySetOfEffectsAndEveryModeOverRandomGestures) {
  static constexpr std::array<double, 6> kRates_hz = {250, 333, 1000, 500, 2000, 10'000};
  const LimbKind limb = GetParam();
  GestureRange range;
  range.legs = longForm() ? 10 : 3;
  range.most_leg_s = 0.3;
  range.most_hold_s = 0.25;
  int failures = 0;
  std::uint64_t run = 0;
  Seen seen;
  for (EffectMask effects = 0; effects <= kPlacedEffects && failures < 3; ++effects)
    for (const auto clamping : {ClampingMode::kProportional, ClampingMode::kConservative})
      for (const auto stop : {StopMode::kRamp, StopMode::kExponential}) {
        ++run;
        for (std::size_t r = 0; r < kRates_hz.size(); ++r) {
          // the short form takes one rate per combination, the fastest one rarely
          const std::size_t turn = run % 24 == 0 ? 5 : run % 5;
          if (!longForm() && r != turn) continue;
          const std::uint64_t seed = run * 100 + r * 10 + static_cast<std::uint64_t>(limb);
          range.tremor_m = seed % 3 == 0 ? 2e-4 : 0.0;
          const Motion motion = randomGesture(seed, kRates_hz[r], siteOf(limb), range);
          const auto difference = firstDifference(variant(effects, limb, clamping, stop, run % 3 == 0),
                                                  kRates_hz[r], motion, &seen);
          EXPECT_FALSE(difference) << named(effects, limb, clamping, stop, kRates_hz[r], seed) << "\n"
                                   << *difference;
          if (difference) ++failures;
        }
      }
  constexpr std::uint32_t kEverything = kFlagEntry | kFlagExit | kFlagLayerChange | kFlagRupture | kFlagTurn |
                                        kFlagClampCapped | kFlagTorque | kFlagBeyondNeedle;
  EXPECT_EQ(seen.flags & kEverything, kEverything) << "the gestures must go through everything";
  EXPECT_EQ(seen.phases, 0b1111u);
}

TEST_P(ReferencePerLimb, slowAndFastRealGestures) {
  const LimbKind limb = GetParam();
  const Site site = siteOf(limb);
  for (const double rate_hz : {250.0, 1000.0, 4000.0}) {
    SceneSpec scene = withLimb(allEffects(), limb);
    Motion motion = insertHoldWithdraw(rate_hz, site, site.inward, site.inward, 0.03, 0.04, 1.2);
    const Vec3 slanted = tilted(site.inward, 0.7, site.across_1);
    motion = joined(motion, insertHoldWithdraw(rate_hz, site, slanted, slanted, 0.025, 0.02, 0.4));
    motion = joined(motion, multipleEntries(5, rate_hz, site, 4));
    motion = joined(motion, grazing(rate_hz, site, 0.0875, 0.03, 0.05));
    for (const double tremor_m : {0.0, 5e-5}) {
      const auto difference = firstDifference(scene, rate_hz, withTremor(motion, rate_hz, tremor_m, 9));
      EXPECT_FALSE(difference) << rate_hz << " Hz, tremor " << tremor_m << "\n" << *difference;
    }
    const auto coarse =
        firstDifference(scene, rate_hz, quantised(withTremor(motion, rate_hz, 5e-5, 4), 3e-5));
    EXPECT_FALSE(coarse) << rate_hz << " Hz, encoder of 30 µm\n" << *coarse;
  }
}

INSTANTIATE_TEST_SUITE_P(Limbs, ReferencePerLimb, ::testing::ValuesIn(kLimbKinds), [](const auto& chosen) {
  std::string name(limbName(chosen.param));
  std::erase(name, ' ');
  return name;
});

// wide sideways sweeps at depth make u turn, up to the cone and along it
TEST(EngineReference, trajectoryChangesUpToTheConeAndAlongIt) {
  const Site site = defaultSite();
  for (const auto clamping : {ClampingMode::kProportional, ClampingMode::kConservative})
    for (const double f_max_N : {0.0, 0.3, 2.0})
      for (const double rate_hz : {500.0, 1000.0, 4000.0}) {
        if (rate_hz > 1000 && f_max_N != 0.3 && !longForm()) continue;
        SceneSpec scene = withClamping(allEffects(), clamping);
        scene.virtual_fixture.max_force_N = f_max_N;
        const auto at = [&](double depth, double a, double b) {
          return site.p_surface_m + site.inward * depth + site.across_1 * a + site.across_2 * b;
        };
        MotionBuilder builder(rate_hz, at(-0.005, 0, 0), site.inward);
        builder.moveTo(at(0.02, 0, 0), 0.3)
            .moveTo(at(0.02, 0.015, 0), 0.3)
            .moveTo(at(0.03, 0.04, 0.005), 0.4);
        builder.hold(0.2).moveTo(at(0.03, 0.02, 0.03), 0.3).moveTo(at(0.045, -0.03, 0.01), 0.4).hold(0.1);
        builder.moveTo(at(0.01, -0.02, 0), tilted(site.inward, 0.5, site.across_2), 0.3)
            .moveTo(at(-0.01, 0, 0), 0.3);
        const Motion motion = builder.take();
        const auto difference = firstDifference(scene, rate_hz, motion);
        EXPECT_FALSE(difference) << rate_hz << " Hz, f_max " << f_max_N << "\n" << *difference;
      }
}

// scenes with numbers drawn at random over their useful ranges
TEST(EngineReference, randomScenes) {
  const int scenes = longForm() ? 2000 : 24;
  int failures = 0;
  for (int i = 0; i < scenes && failures < 3; ++i) {
    Random random(static_cast<std::uint64_t>(i) + 77);
    SceneSpec scene;
    const std::uint64_t layers = 1 + random.below(32);
    for (std::uint64_t n = 0; n < layers; ++n) {
      LayerSpec layer;
      layer.thickness_m = random.in(0.0005, 0.012);
      layer.cutting_force_N = random.chance(0.2) ? 0.0 : random.in(0, 4);
      layer.attracted_force_N = random.chance(0.2) ? 0.0 : random.in(0, 1.5);
      layer.rejection_force_N = random.unit() * std::min(layer.cutting_force_N, layer.attracted_force_N);
      layer.lateral_stiffness_N_per_m2 = random.chance(0.2) ? 0.0 : random.in(0, 40'000);
      layer.friction_N_per_m = random.chance(0.2) ? 0.0 : random.in(0, 40);
      if (random.chance(0.3))
        layer.membrane = MembraneSpec{random.in(0, 400), random.in(1, 40'000), random.in(0.05, 1.5)};
      scene.layers.push_back(layer);
    }
    scene.effects = static_cast<EffectMask>(random.below(kPlacedEffects + 1));
    scene.needle_length_m = random.in(0.02, 0.1);
    scene.tracking_wall.stiffness_N_per_m = random.in(100, 3000);
    scene.tracking_wall.stop_speed_mps = random.in(0.001, 0.01);
    scene.tracking_wall.stop_dwell_s = random.in(0.0001, 0.1);
    scene.tracking_wall.stop_duration_s = random.in(0.0001, 1);
    scene.tracking_wall.stop_mode = random.chance(0.5) ? StopMode::kRamp : StopMode::kExponential;
    scene.tracking_wall.relax_residual = random.unit();
    scene.tracking_wall.relax_time_s = random.in(0.01, 2);
    scene.virtual_fixture.max_stiffness_N_per_m = random.in(10, 1000);
    scene.virtual_fixture.max_force_N = random.chance(0.1) ? 0.0 : random.in(0, 4);
    scene.virtual_fixture.mode =
        random.chance(0.5) ? ClampingMode::kProportional : ClampingMode::kConservative;
    scene.orientation_limit = {random.in(0, 2), random.in(0, 0.4)};
    scene.friction_stiffness_N_per_m = random.in(20, 500);
    scene.max_force_N = random.in(0.5, 10);
    const LimbKind limb = kLimbKinds[random.below(kLimbKinds.size())];
    scene.limb = limbOf(limb);
    const double rate_hz = random.in(60, 3000);
    const Motion motion = randomGesture(random.bits(), rate_hz, siteOf(limb));
    const auto difference = firstDifference(scene, rate_hz, motion);
    EXPECT_FALSE(difference) << "scene " << i << ", effects mask " << scene.effects << ", " << rate_hz
                             << " Hz\n"
                             << *difference;
    if (difference) ++failures;
  }
}

}  // namespace
}  // namespace needlelab::test
