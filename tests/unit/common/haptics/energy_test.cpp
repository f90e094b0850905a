// Properties over random gestures (tests/stability/README.md, `random_energy`, with prescribed motion): with
// CONSERVATIVE clamping the scene gives the hand no energy, and no force jumps outside declared releases.
#include <gtest/gtest.h>

#include <cmath>

#include "common/haptics/effects/trajectory.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

// slow enough for the trapezoidal rule at this rate: the springs' force is linear between two ticks
constexpr double kRate_hz = 2000;

GestureRange slowGestures() {
  GestureRange range;
  range.least_leg_s = 0.4;
  range.most_leg_s = 1.2;
  range.legs = 3;
  range.most_hold_s = 0.4;
  return range;
}

double worstEnergy(LimbKind limb, ClampingMode mode, int gestures) {
  const SceneSpec scene = withClamping(withLimb(allEffects(), limb), mode);
  double worst = -1;
  for (int i = 0; i < gestures; ++i) {
    const Motion motion =
        randomGesture(static_cast<std::uint64_t>(i) + 1, kRate_hz, siteOf(limb), slowGestures());
    EngineRun run(scene, kRate_hz);
    worst = std::max(worst, energyToHand(motion, run.run(motion)));
  }
  return worst;
}

TEST(Energy, passiveSceneGivesTheHandNothing) {
  const int gestures = longForm() ? 1000 : 50;  // on each of four limbs
  for (const LimbKind limb : kLimbKinds)
    EXPECT_LE(worstEnergy(limb, ClampingMode::kConservative, gestures), 5e-5) << limbName(limb);
}

TEST(Energy, clampingAloneIsPassiveToo) {
  const int gestures = longForm() ? 1000 : 25;
  for (const double f_max_N : {0.5, 4.0}) {
    SceneSpec scene =
        withEffects(withClamping(allEffects(), ClampingMode::kConservative), bitOf(Effect::kClamping));
    scene.virtual_fixture.max_force_N = f_max_N;
    for (int i = 0; i < gestures; ++i) {
      const Motion motion =
          randomGesture(static_cast<std::uint64_t>(i) + 50, kRate_hz, defaultSite(), slowGestures());
      EngineRun run(scene, kRate_hz);
      EXPECT_LE(energyToHand(motion, run.run(motion)), 5e-5) << "gesture " << i << ", f_max " << f_max_N;
    }
  }
}

TEST(Energy, orientationLimitAloneIsPassive) {
  const SceneSpec scene = withEffects(allEffects(), bitOf(Effect::kOrientationLimit));
  for (int i = 0; i < 25; ++i) {
    const Motion motion =
        randomGesture(static_cast<std::uint64_t>(i) + 90, kRate_hz, defaultSite(), slowGestures());
    EngineRun run(scene, kRate_hz);
    EXPECT_LE(energyToHand(motion, run.run(motion)), 5e-5) << "gesture " << i;
  }
}

// outside declared releases no force step beyond ΣK·|Δp|/c, ΣK = K_t + K_f + k + k1 + 2·k2·z
TEST(Energy, noForceStepWithoutADeclaredRelease) {
  const int gestures = longForm() ? 500 : 15;
  for (const LimbKind limb : {LimbKind::kPlane, LimbKind::kSphere}) {
    const SceneSpec scene = withClamping(withLimb(allEffects(), limb), ClampingMode::kConservative);
    double steepest = 0;
    for (const auto& layer : scene.layers)
      if (layer.membrane)
        steepest += std::sqrt(layer.membrane->linear_N_per_m * layer.membrane->linear_N_per_m +
                              4 * layer.membrane->quadratic_N_per_m2 * layer.membrane->force_N);
    double worst_N = 0;
    for (int i = 0; i < gestures; ++i) {
      const Motion motion = randomGesture(static_cast<std::uint64_t>(i) + 300, 1000, siteOf(limb));
      EngineRun run(scene, 1000);
      StepReport before = run.step(motion.front());
      for (std::size_t k = 1; k < motion.size(); ++k) {
        const StepReport now = run.step(motion[k]);
        constexpr std::uint32_t kReleases = kFlagExit | kFlagLayerChange | kFlagRupture;
        if (!(now.flags & kReleases)) {
          double sum_K = 500 + 140 + now.clamping_stiffness_N_per_m + steepest;
          // a hole dragged along under the skin moves up to five times as far as the tip
          LayersAlong along = run.state().along;
          if ((now.flags & kFlagTurn) != 0)
            sum_K += kSlack * (now.clamping_stiffness_N_per_m +
                               lateralStiffness(along, now.insertion_m).slope_N_per_m2 * now.lateral_error_m);
          const double way = norm(motion[k].p_WT_m - motion[k - 1].p_WT_m);
          const double c = now.layer < 0 ? 1.0 : run.state().slant;
          const double step = norm(now.wrench_W.force_N - before.wrench_W.force_N);
          worst_N = std::max(worst_N, step - sum_K * way / c);
        }
        before = now;
      }
    }
    EXPECT_LE(worst_N, 0.05) << limbName(limb);
  }
}

// heldEnergy_J against the work that a slow way back gets: no less, and not much more. At these depths
// tissue, a membrane, or both are stretched; then the fixture, aside, to where its force is at its greatest.
TEST(HeldEnergy, isWhatASlowWayBackGets) {
  const SceneSpec scene = withClamping(allEffects(), ClampingMode::kConservative);
  const Quat down{1, 0, 0, 0};
  struct Stretch {
    double depth_m, aside_m;
  };
  double greatest_J = 0;
  for (const Stretch& to : {Stretch{0.001, 0}, Stretch{0.0021, 0}, Stretch{0.008, 0}, Stretch{0.02, 0},
                            Stretch{0.02, 0.002}, Stretch{0.02, 0.006}, Stretch{0.03, 0.012}}) {
    EngineRun run(scene, kRate_hz);
    Vec3 before_W_m{0, 0, 0.005};
    StepReport report = run.step({before_W_m, down});
    const auto go = [&](Vec3 by) {
      const Vec3 now_W_m = before_W_m + by;
      const StepReport next = run.step({now_W_m, down});
      const double work_J = 0.5 * dot(report.wrench_W.force_N + next.wrench_W.force_N, by);
      before_W_m = now_W_m;
      report = next;
      return work_J;
    };
    while (before_W_m.z > -to.depth_m) go({0, 0, -1e-5});
    while (before_W_m.x < to.aside_m) go({1e-5, 0, 0});
    const double held_J = heldEnergy_J(run.model(), run.state(), report);
    double back_J = 0, most_J = 0;
    while (before_W_m.x > 0) most_J = std::max(most_J, back_J += go({-1e-5, 0, 0}));
    while (before_W_m.z < 0) most_J = std::max(most_J, back_J += go({0, 0, 1e-5}));
    EXPECT_GE(held_J, 0.99 * most_J) << to.depth_m << ", " << to.aside_m;
    EXPECT_LE(held_J, 1.25 * most_J) << to.depth_m << ", " << to.aside_m;
    greatest_J = std::max(greatest_J, most_J);
  }
  EXPECT_GT(greatest_J, 3e-3);
}

}  // namespace
}  // namespace needlelab::test
