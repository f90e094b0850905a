// Cutting and attracted force (FORCE_MODEL.md, "Tracking wall"): eq. 1, 2, 6, the stop in both modes, and
// pure dissipation.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

SceneSpec wallScene(double cutting_N = 1.0, double attracted_N = 0.5, double rejection_N = 0.1) {
  return withEffects(oneLayer(cutting_N, attracted_N, rejection_N), kAxial);
}

TEST(TrackingWall, forceRisesThroughTheSpringThenStays) {
  Probe probe(wallScene(), 1000);
  probe.at(-1e-4);
  for (int i = 1; i <= 400; ++i) {
    const double x = 2e-5 * i;  // 20 mm/s
    ASSERT_NEAR(probe.at(x).cutting_N, -std::min(500 * x, 1.0), 1e-9);
    ASSERT_NEAR(probe.last().p_wall_W_m.z, -std::max(0.0, x - 0.002), 1e-12) << "the wall is at P0 + u·w";
  }
}

TEST(TrackingWall, onWithdrawalItRestsThenIsPushedAhead) {
  Probe probe(wallScene(), 1000);
  probe.at(-1e-4);
  probe.go(400, 0.010);
  for (int i = 1; i <= 300; ++i) {
    const double x = 0.010 - 2e-5 * i;
    const double stretch = std::max(x - 0.008, -0.001);  // wall at 8 mm until 0.5 N / 500 N/m
    const StepReport report = probe.at(x);
    ASSERT_NEAR(report.cutting_N + report.attracted_N, -500 * stretch, 1e-9);
    ASSERT_TRUE(report.cutting_N == 0 || report.attracted_N == 0) << "only one of them acts at a time";
    ASSERT_LE(report.cutting_N, 0.0);
    ASSERT_GE(report.attracted_N, 0.0);
  }
}

TEST(TrackingWall, attractedForceFadesOutTowardTheExit) {
  Probe probe(wallScene(), 1000);
  probe.at(-1e-4);
  probe.go(300, 0.010);
  probe.go(300, 0.002);
  for (int i = 1; i < 100; ++i) {
    const double x = 0.002 - 2e-5 * i;
    ASSERT_NEAR(probe.at(x).attracted_N, 500 * std::min(0.001, x), 1e-9);  // Δ_att = min(f/K, d_t)
  }
}

TEST(TrackingWall, speedIsAveragedOverATenthOfASecond) {
  Probe probe(wallScene(), 1000);
  probe.at(-1e-5);
  // before the window is full: from x = 0 at the tick before entry
  for (int i = 1; i <= 250; ++i) {
    const double x = 1e-8 * i * i;
    const double x_then = i > 100 ? 1e-8 * (i - 100) * (i - 100) : 0.0;
    ASSERT_NEAR(probe.at(x).speed_mps, (x - x_then) / (std::min(i, 100) * 1e-3), 1e-10) << i;
  }
}

TEST(TrackingWall, aStopEndsAtTwiceTheStopSpeedOnly) {
  Probe probe(wallScene(), 1000);
  probe.at(-1e-4);
  probe.go(200, 0.006);
  ASSERT_EQ(probe.stay(300).back().phase, Phase::kStopped);
  for (const auto& report : probe.go(400, 0.008)) ASSERT_EQ(report.phase, Phase::kStopped) << "5 mm/s";
  probe.stay(200);
  const auto reports = probe.go(200, 0.0096);  // 8 mm/s
  for (const auto& report : reports)
    ASSERT_EQ(report.phase, report.speed_mps < 0.006 ? Phase::kStopped : Phase::kInserting)
        << report.speed_mps;
  EXPECT_EQ(reports.back().phase, Phase::kInserting);
}

TEST(TrackingWall, physiologicalTremorDoesNotHideAStop) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    const Motion still = insertHoldWithdraw(1000, defaultSite(), {0, 0, -1}, {0, 0, -1}, 0.015, 0.02, 2.0);
    const Motion motion = withTremor(still, 1000, 5e-5, seed);
    EngineRun run(wallScene(), 1000);
    int stopped = 0, hold = 0;
    for (std::size_t k = 0; k < motion.size(); ++k) {
      const StepReport report = run.step(motion[k]);
      if (k < 1000 + 200 || k >= 1000 + 2000) continue;  // 1 s of motion, then the hold
      ++hold;
      stopped += report.phase == Phase::kStopped;
    }
    EXPECT_EQ(stopped, hold) << "seed " << seed;
  }
}

TEST(TrackingWall, theStopNeverMovesFasterThanOneAndAHalfStopSpeeds) {
  SceneSpec scene = wallScene(4.0, 0.4, 0.1);
  scene.tracking_wall.stiffness_N_per_m = 100;
  scene.tracking_wall.stop_duration_s = 0.02;
  Probe probe(scene, 1000);
  probe.at(-1e-4);
  probe.go(1000, 0.060);
  const auto hold = probe.stay(1500);
  const double max_N = 100 * 1.5 * 0.003 * 1e-3;
  for (std::size_t k = 1; k < hold.size(); ++k) {
    const double change = hold[k].cutting_N - hold[k - 1].cutting_N;
    ASSERT_LE(change, max_N + 1e-12);
    if (hold[k - 1].phase != Phase::kStopped) continue;
    ASSERT_NEAR(change, max_N, 1e-12) << "still far away: at the cap";
  }
}

// the wall may not pass a needle that retreats during the ramp: that would pull it in
TEST(TrackingWall, retreatDuringTheRampIsNeverPulledInward) {
  for (const double retreat_m : {0.0005, 0.001, 0.003}) {
    SceneSpec scene = wallScene();
    scene.tracking_wall.stop_speed_mps = 0.01;  // so that the retreat happens inside the stop
    Probe probe(scene, 1000);
    probe.at(-1e-4);
    probe.go(300, 0.012);
    std::vector<StepReport> reports = probe.stay(250);
    ASSERT_EQ(reports.back().phase, Phase::kStopped);
    double pull_work_J = 0, before_N = probe.last().attracted_N;
    for (const auto& report : probe.go(400, 0.012 - retreat_m)) {
      // the needle moves outward (−u): a force along +u resists, so its work on the hand must not be positive
      pull_work_J += 0.5 * (report.attracted_N + before_N) * (-retreat_m / 400);
      before_N = report.attracted_N;
      ASSERT_GE(report.attracted_N, 0.0);
      ASSERT_LE(report.cutting_N, 0.0);
    }
    // Held again: an inward pull would now move a loose hand in; it decays to the rejection force.
    for (const auto& report : probe.stay(1500)) ASSERT_LE(report.attracted_N, before_N + 1e-12);
    EXPECT_LE(pull_work_J, 0.0) << "attracted force resists the retreat, it never helps";
  }
}

TEST(TrackingWall, exponentialStopFollowsItsFormula) {
  SceneSpec scene = wallScene(1.0, 0.5, 0.1);
  scene.tracking_wall.stop_mode = StopMode::kExponential;
  scene.tracking_wall.relax_time_s = 0.5;
  scene.tracking_wall.relax_residual = 0.6;
  Probe probe(scene, 1000);
  probe.at(-1e-4);
  probe.go(300, 0.012);
  const auto hold = probe.stay(3000);
  std::size_t first = 0;
  while (hold[first].phase != Phase::kStopped) ++first;
  for (std::size_t k = first; k < hold.size(); ++k) {
    const double after_s = static_cast<double>(k - first + 1) * 1e-3;
    ASSERT_NEAR(hold[k].cutting_N, -(0.6 + 0.4 * std::exp(-after_s / 0.5)), 1e-9);
  }
}

TEST(TrackingWall, exponentialStopNeverGoesBelowTheRejectionForce) {
  SceneSpec scene = wallScene(1.0, 0.5, 0.3);
  scene.tracking_wall.stop_mode = StopMode::kExponential;
  scene.tracking_wall.relax_time_s = 0.1;
  scene.tracking_wall.relax_residual = 0.0;
  Probe probe(scene, 1000);
  probe.at(-1e-4);
  probe.go(300, 0.012);
  EXPECT_NEAR(probe.stay(3000).back().cutting_N, -0.3, 1e-9);
}

// each move of the wall makes |x − w| smaller: this element can only absorb energy
TEST(TrackingWall, everyMoveOfTheWallShrinksTheStretch) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SceneSpec scene = withEffects(paperSixLayers(), kAxial);
    scene.tracking_wall.stop_mode = seed % 2 ? StopMode::kRamp : StopMode::kExponential;
    EngineRun run(scene, 1000);
    for (const auto& sample : randomGesture(seed, 1000, defaultSite())) {
      const double wall_before = run.state().wall_m - run.state().x_shift_m;
      const StepReport report = run.step(sample);
      if (report.layer < 0 || (report.flags & kFlagEntry)) continue;
      const double x = dot(run.state().u_W, sample.p_WT_m - run.state().p_entry_W_m);
      ASSERT_LE(std::abs(x - run.state().wall_m), std::abs(x - wall_before - run.state().x_shift_m) + 1e-15)
          << "seed " << seed;
    }
  }
}

// So the work on the hand is not positive over any gesture that starts and ends outside.
TEST(TrackingWall, givesNoEnergyOverAnyGesture) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    GestureRange slow;
    slow.least_leg_s = 0.6;
    slow.most_leg_s = 1.5;
    const Motion motion = randomGesture(seed, 4000, defaultSite(), slow);
    EngineRun run(withEffects(paperSixLayers(), kAxial), 4000);
    EXPECT_LE(forceWork(motion, run.run(motion)), 1e-6) << "seed " << seed;
  }
}

}  // namespace
}  // namespace needlelab::test
