// Hostile motion: the force stays finite and within the limit, |u| = 1 ± 1e-12, for any tip motion.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "common/haptics/gate/force_gate.h"
#include "tests/support/random.h"
#include "tests/support/scenes/model_scenes.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

// A tip that teleports, rests, creeps, grazes the surface, points anywhere, and is sometimes NaN.
class HostileTip {
 public:
  HostileTip(std::uint64_t seed, const Site& site) : random_(seed), site_(site), p_(site.p_surface_m) {}

  TipSample next() {
    switch (random_.below(12)) {
      case 0:
        p_ = site_.p_surface_m + anywhere(0.1);
        break;
      case 1:
        p_ = site_.p_surface_m + anywhere(1e-3);
        break;
      case 2:
        p_ = site_.p_surface_m + site_.inward * random_.in(-1e-9, 1e-9);
        break;
      case 3:
        p_ = site_.p_surface_m + site_.inward * random_.in(0, 0.2);
        break;
      case 4:
        p_ += anywhere(1e-15);
        break;
      case 5:
        p_ += anywhere(1e-3) + anywhere(1e-6);
        break;
      case 6:
        p_ = site_.p_surface_m - site_.inward * 0.01;
        break;
      default:
        p_ += site_.inward * random_.in(-1e-3, 1.5e-3) + anywhere(2e-4);
        break;
    }
    if (random_.chance(0.001)) p_ = anywhere(1e3);
    if (random_.chance(0.3)) q_ = anyRotation();
    TipSample sample{p_, q_};
    if (random_.chance(0.002)) sample.p_WT_m.x = random_.chance(0.5) ? std::nan("") : HUGE_VAL;
    if (random_.chance(0.002)) sample.q_WT.w = random_.chance(0.5) ? std::nan("") : -HUGE_VAL;
    return sample;
  }

 private:
  Vec3 anywhere(double most) {
    const double x = random_.in(-most, most), y = random_.in(-most, most), z = random_.in(-most, most);
    return {x, y, z};
  }
  Quat anyRotation() {
    if (random_.chance(0.1)) return pointing(random_.chance(0.5) ? site_.inward : -site_.inward);
    const double x = random_.in(-1, 1), y = random_.in(-1, 1), z = random_.in(-1, 1), w = random_.in(-1, 1);
    return normalized(Quat{x, y, z, w + 1e-3});
  }
  Random random_;
  Site site_;
  Vec3 p_;
  Quat q_;
};

// rendered by any model; two of them replace listed effects with their own
SceneSpec anyModel(SceneSpec scene, Random& random) {
  const AxialModel model = kAllModels[random.below(kAllModels.size())];
  const EffectMask listed = scene.effects;
  scene = renderedBy(scene, model);
  scene.effects &= listed;
  scene.statistical.correlation_length_m = random.chance(0.2) ? 1e-9 : random.in(1e-4, 1);
  scene.direct.step_at_layers = random.chance(0.5);
  return scene;
}

TEST(EngineFuzz, everyTickIsFiniteWithinTheLimitAndKeepsAUnitDirection) {
  const int ticks = longForm() ? 2'000'000 : 200'000;
  constexpr int kTicksAScene = 2'000;
  for (int scene_number = 0; scene_number * kTicksAScene < ticks; ++scene_number) {
    Random random(static_cast<std::uint64_t>(scene_number));
    const LimbKind limb = kLimbKinds[random.below(kLimbKinds.size())];
    SceneSpec scene = withLimb(allEffects(), limb);
    scene.effects =
        random.chance(0.5) ? kPlacedEffects : static_cast<EffectMask>(random.below(kPlacedEffects + 1));
    scene.virtual_fixture.mode =
        random.chance(0.5) ? ClampingMode::kConservative : ClampingMode::kProportional;
    scene.virtual_fixture.max_force_N = random.chance(0.2) ? 0.0 : random.in(0, 5);
    scene.tracking_wall.stop_mode = random.chance(0.5) ? StopMode::kRamp : StopMode::kExponential;
    scene.tracking_wall.stiffness_N_per_m = random.chance(0.1) ? 1e4 : random.in(50, 1000);
    scene.max_force_N = random.in(0.1, 10);
    scene.needle_length_m = random.chance(0.2) ? 1e-3 : 0.06;
    scene = anyModel(scene, random);
    EngineRun run(scene, random.chance(0.5) ? 1000 : random.in(50, 40'000));
    HostileTip tip(random.bits(), siteOf(limb));
    for (int k = 0; k < kTicksAScene; ++k) {
      const StepReport r = run.step(tip.next());
      ASSERT_TRUE(isFinite(r.wrench_W.force_N) && isFinite(r.wrench_W.torque_Nm)) << scene_number << " " << k;
      ASSERT_LE(norm(r.wrench_W.force_N), scene.max_force_N * (1 + 1e-12)) << scene_number << " " << k;
      ASSERT_LE(norm(r.wrench_W.torque_Nm), scene.orientation_limit.max_torque_Nm * (1 + 1e-12));
      for (const double value :
           {r.depth_m, r.insertion_m, r.speed_mps, r.lateral_error_m, r.cutting_N, r.attracted_N,
            r.friction_N, r.puncture_N, r.clamping_N, r.clamping_stiffness_N_per_m})
        ASSERT_TRUE(std::isfinite(value)) << scene_number << " " << k;
      ASSERT_GE(r.insertion_m, 0.0);
      ASSERT_LE(r.cutting_N, 0.0);
      ASSERT_GE(r.attracted_N, 0.0);
      ASSERT_LE(r.puncture_N, 0.0);
      ASSERT_GE(r.clamping_N, 0.0);
      if (!run.state().inside || (r.flags & kFlagNotStepped)) continue;
      ASSERT_NEAR(norm(run.state().u_W), 1.0, 1e-12) << scene_number << " " << k;
      ASSERT_GE(r.layer, 0);
      ASSERT_LT(r.layer, static_cast<int>(scene.layers.size()));
    }
  }
}

TEST(EngineFuzz, theReferenceAgreesOnHostileMotionThatIsANumber) {
  for (int i = 0; i < (longForm() ? 200 : 20); ++i) {
    Random random(static_cast<std::uint64_t>(i) + 1000);
    const LimbKind limb = kLimbKinds[random.below(kLimbKinds.size())];
    HostileTip tip(random.bits(), siteOf(limb));
    Motion motion;
    while (motion.size() < 1000) {
      const TipSample sample = tip.next();
      if (norm(sample.p_WT_m) < 10) motion.push_back(sample);
    }
    const auto difference = firstDifference(withLimb(allEffects(), limb), 1000, motion);
    EXPECT_FALSE(difference) << i << "\n" << *difference;
  }
}

// With the gate in front, as in the haptic loop, no device data can do harm, not even 1e308.
TEST(EngineFuzz, gateAndEngineTogetherStandAnySample) {
  const int ticks = longForm() ? 2'000'000 : 100'000;
  Random random(99);
  EngineRun run(allEffects(), 1000);
  ForceGate gate(DeviceLimits{}, 1000);
  const auto anyNumber = [&]() -> double {
    switch (random.below(6)) {
      case 0:
        return std::bit_cast<double>(random.bits());
      case 1:
        return random.in(-1e308, 1e308);
      default:
        return random.in(-0.02, 0.02);
    }
  };
  double z = 0.003;
  int stepped = 0;
  for (int k = 0; k < ticks; ++k) {
    z += random.in(-1e-3, 1e-3);
    if (random.chance(0.001)) z = 0.002;
    TipSample sample{{0, 0, z}, pointing({0, 0, -1})};
    if (random.chance(0.01)) sample.p_WT_m = {anyNumber(), anyNumber(), anyNumber()};
    if (random.chance(0.01)) sample.q_WT = {anyNumber(), anyNumber(), anyNumber(), anyNumber()};
    Wrench wanted;
    if (gate.admit(sample, random.chance(0.99), random.chance(0.9999) ? 0.1 : anyNumber())) {
      const StepReport report = run.step(sample);
      wanted = report.wrench_W;
      ++stepped;
    }
    gate.noteOutside(signedDepth(run.model().limb, sample.p_WT_m) <= 0);
    const Wrench out = gate.guard(wanted).wrench();
    ASSERT_TRUE(isFinite(out.force_N) && isFinite(out.torque_Nm)) << k;
    ASSERT_LE(norm(out.force_N), 10 + 1e-9) << k;
    if (gate.fault() != Fault::kNone && random.chance(0.05)) gate.acknowledge();
    if (gate.fault() != Fault::kNone) z = 0.001;
  }
  EXPECT_GT(stepped, ticks / 2);
}

}  // namespace
}  // namespace needlelab::test
