// VIBRATION after a rupture, against its formula.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/haptics/effects/effect_entry.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr double kForce_N = 0.4, kFrequency_hz = 60, kDecay_s = 0.05, kRate_hz = 1000;

SceneSpec ringingScene(EffectMask effects) {
  SceneSpec scene = withEffects(allEffects(), effects);
  const EffectEntry& vibration = effectEntry(Effect::kVibration);
  vibration.fields[0].of(scene) = kForce_N;
  vibration.fields[1].of(scene) = kFrequency_hz;
  vibration.fields[2].of(scene) = kDecay_s;
  return scene;
}

TEST(Vibration, ringsAfterARuptureByItsFormula) {
  Probe probe(ringingScene(bitOf(Effect::kPuncture) | bitOf(Effect::kVibration)), kRate_hz);
  probe.at(-0.001);
  bool ruptured = false;
  for (const StepReport& report : probe.go(100, 0.0055)) {
    EXPECT_EQ(report.stage_N[0], 0) << "nothing gave way before";
    ruptured = (report.flags & kFlagRupture) != 0;
    if (ruptured) break;
  }
  ASSERT_TRUE(ruptured);
  Probe again(ringingScene(bitOf(Effect::kPuncture) | bitOf(Effect::kVibration)), kRate_hz);
  again.at(-0.001);
  while ((again.at(again.last().depth_m + 0.0001).flags & kFlagRupture) == 0) {
  }
  int tick = 0;
  for (const StepReport& report : again.stay(150)) {
    const double t_s = ++tick / kRate_hz;
    const double expected_N =
        kForce_N * std::exp(-t_s / kDecay_s) * std::sin(2 * std::numbers::pi * kFrequency_hz * t_s);
    ASSERT_NEAR(report.stage_N[0], expected_N, 1e-9) << "tick " << tick;
    ASSERT_NEAR(dot(report.wrench_W.force_N, again.state().u_W), expected_N + report.puncture_N, 1e-9);
  }
}

TEST(Vibration, isNotLiveWithoutAForce) {
  SceneSpec scene = ringingScene(kAllEffects);
  EXPECT_TRUE(compiled(scene, kRate_hz).isLive(Effect::kVibration));
  effectEntry(Effect::kVibration).fields[0].of(scene) = 0;
  EXPECT_FALSE(compiled(scene, kRate_hz).isLive(Effect::kVibration));
}

}  // namespace
}  // namespace needlelab::test
