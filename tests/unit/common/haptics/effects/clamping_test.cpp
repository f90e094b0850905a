// Clamping force and change of trajectory (FORCE_MODEL.md, "Clamping") by formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/haptics/scene_model.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr EffectMask kClamping = bitOf(Effect::kClamping);

SceneSpec clampingScene(double lateral_N_per_m2, ClampingMode mode, double f_max_N = 50) {
  SceneSpec scene = withEffects(withClamping(oneLayer(1, 0.5, 0.1), mode), kClamping);
  scene.layers[0].lateral_stiffness_N_per_m2 = lateral_N_per_m2;
  scene.virtual_fixture.max_force_N = f_max_N;
  scene.max_force_N = 50;
  return scene;
}

// β
double holdAngle(const SceneSpec& scene, double d_m) {
  return std::atan(std::min(1.0, 1e-4 + std::pow(d_m / scene.needle_length_m, 2)));
}

double angleOf(Vec3 a, Vec3 b) {
  return std::atan2(norm(cross(a, b)), dot(a, b));
}

// ∫₀^d lateral stiffness ds in a plane, averaged over d ± 4 mm
double blended(const SceneSpec& scene, double d_m, double c) {
  const auto integral = [&](double d) {
    double left = d * c, sum = 0;  // negative: the first layer extends upwards
    for (std::size_t i = 0; i < scene.layers.size() && (left > 0 || i == 0); ++i) {
      const bool last = i + 1 == scene.layers.size();
      const double here = last ? left : std::min(left, scene.layers[i].thickness_m);
      sum += scene.layers[i].lateral_stiffness_N_per_m2 * here / c;
      left -= here;
    }
    return std::min(sum, scene.virtual_fixture.max_stiffness_N_per_m);
  };
  constexpr int kParts = 2000;  // midpoint rule; its error at kinks is the square of a part
  double mean = 0;
  for (int i = 0; i < kParts; ++i) mean += integral(d_m - 4e-3 + 8e-3 * (i + 0.5) / kParts);
  return mean / kParts;
}

TEST(Clamping, stiffnessIsTheIntegralOverTheLayersCrossed) {
  SceneSpec scene = withEffects(paperSixLayers(), kClamping);
  scene.virtual_fixture.max_stiffness_N_per_m = 10'000;
  for (const double tangent : {0.0, 0.8}) {
    const Vec3 axis = tilted({0, 0, -1}, tangent, {1, 0, 0});
    EngineRun run(scene, 1000);
    for (const auto& sample : insertHoldWithdraw(1000, defaultSite(), axis, axis, 0.045, 0.05, 0.01)) {
      const StepReport report = run.step(sample);
      if (report.layer < 0) continue;
      const double length = -sample.p_WT_m.z / -axis.z;
      ASSERT_NEAR(report.insertion_m, length, 1e-12);
      ASSERT_NEAR(report.clamping_stiffness_N_per_m, blended(scene, length, -axis.z), 1e-5);
      ASSERT_NEAR(report.clamping_N, 0, 1e-9) << "on the line there is no clamping force";
    }
  }
}

TEST(Clamping, stiffnessStopsAtItsMaximum) {
  SceneSpec scene = clampingScene(3e4, ClampingMode::kProportional);
  scene.virtual_fixture.max_stiffness_N_per_m = 300;
  Probe probe(scene, 1000);
  probe.at(-1e-4);
  probe.go(100, 0.0059);
  EXPECT_NEAR(probe.last().clamping_stiffness_N_per_m, 177, 1e-9);
  probe.go(100, 0.01);  // the middle of the blend: a quarter of 3e4 N/m² over 4 mm is missing
  EXPECT_NEAR(probe.last().clamping_stiffness_N_per_m, 270, 1e-9);
  probe.go(100, 0.02);
  EXPECT_NEAR(probe.last().clamping_stiffness_N_per_m, 300, 1e-9);
}

// −∇U of U = ½ k(d_t) e²: eq. 8 toward the line, and ½ k′ e² out of the tissue, away from P0
TEST(Clamping, forceIsTheGradientOfTheEnergy) {
  for (const auto mode : {ClampingMode::kProportional, ClampingMode::kConservative}) {
    Probe probe(clampingScene(10'000, mode), 1000);
    probe.at(-1e-4);
    probe.go(100, 0.02);
    for (int i = 1; i <= 50; ++i) {
      const StepReport report = probe.at(0.02, 4e-5 * i, -2e-5 * i);
      const Vec3 arm = probe.point() - probe.site().p_surface_m;
      const Vec3 e = arm - probe.site().inward * dot(arm, probe.site().inward);
      const double k = 10'000 * norm(arm);
      Vec3 expected = e * -k;
      if (mode == ClampingMode::kConservative)
        expected = expected - arm * (0.5 * 10'000 * normSquared(e) / norm(arm));
      ASSERT_NEAR(norm(report.wrench_W.force_N - expected), 0, 1e-9);
      ASSERT_NEAR(report.clamping_N, norm(expected), 1e-9);
    }
  }
}

// the steepest slope the device must render, from differences of the rendered force
TEST(Clamping, steepnessIsTheGreatestThatAHandFinds) {
  SceneSpec scene = clampingScene(10'000, ClampingMode::kConservative, 4);
  scene.layers[0].thickness_m = 0.012;
  scene.layers.push_back(scene.layers[0]);
  scene.layers[1].lateral_stiffness_N_per_m2 = 16'000;
  scene.virtual_fixture.max_stiffness_N_per_m = 300;
  scene.needle_length_m = 0.06;
  double across = 0, along = 0;
  for (double d_m = 6e-3; d_m < 0.04; d_m += 0.25e-3) {
    Probe probe(scene, 1000);
    probe.at(-1e-4);
    probe.go(400, d_m);
    // as far aside as u holds, minus the difference step
    const double k = probe.last().clamping_stiffness_N_per_m;
    const double cone = std::max(orientationLimitAngle(scene.needle_length_m, d_m), holdAngle(scene, d_m));
    const double e_m = std::min(4 / k, d_m * std::sin(cone)) - 2e-5, x_m = std::sqrt(d_m * d_m - e_m * e_m);
    probe.go(2000, x_m, e_m);
    const Vec3 u_before = probe.state().u_W;
    constexpr double kStep_m = 5e-6;
    const auto slope = [&](double in, double aside_1, double aside_2) {
      const Vec3 more = probe.at(x_m + in, e_m + aside_1, aside_2).wrench_W.force_N;
      return (more - probe.at(x_m - in, e_m - aside_1, -aside_2).wrench_W.force_N) / (-2 * kStep_m);
    };
    const Site& site = probe.site();
    const Vec3 inward = slope(kStep_m, 0, 0), outward = slope(0, kStep_m, 0), about = slope(0, 0, kStep_m);
    ASSERT_EQ(probe.state().u_W, u_before) << d_m;
    const double xx = dot(inward, site.inward), ee = dot(outward, site.across_1);
    const double xe = 0.5 * (dot(inward, site.across_1) + dot(outward, site.inward));
    along = std::max(along, xx);
    across = std::max({across, dot(about, site.across_2),
                       0.5 * (xx + ee) + std::sqrt(0.25 * (xx - ee) * (xx - ee) + xe * xe)});
  }
  const FixtureSteepness steepness = fixtureSteepness(scene);
  EXPECT_NEAR(across, steepness.across_N_per_m, 0.01 * across);
  EXPECT_GT(across, 400);
  EXPECT_NEAR(along, steepness.along_N_per_m, 0.01 * across);
}

// a held pose keeps its force despite tremor and encoder rounding
TEST(Clamping, aHeldPoseKeepsItsForce) {
  for (const double rate_hz : {500.0, 1000.0, 2000.0})
    for (const double encoder_m : {1e-6, 10e-6, 50e-6})
      for (const double tremor_m : {0.0, 1e-4}) {
        Probe probe(clampingScene(7600, ClampingMode::kConservative, 4), rate_hz);
        probe.at(-1e-4);
        probe.go(2000, 0.03);
        probe.go(500, 0.03, 0.008);
        const double held_N = probe.last().clamping_N;
        EXPECT_GT(held_N, 1.8);
        for (int i = 0; i < 10 * rate_hz; ++i) {
          const double t = i / rate_hz;
          const double depth = 0.03 + tremor_m * std::sin(2 * std::numbers::pi * 9 * t);
          probe.at(std::round(depth / encoder_m + (i % 2) * 0.6) * encoder_m, 0.008);
        }
        for (const double out : {0.02, 0.012}) {  // strokes, as far out as u holds
          probe.go(500, out, 0.008);
          probe.go(500, 0.03, 0.008);
        }
        EXPECT_NEAR(probe.at(0.03, 0.008).clamping_N, held_N, 0.01 * held_N)
            << rate_hz << " Hz, encoder " << encoder_m << ", tremor " << tremor_m;
      }
}

TEST(Clamping, conservativeGivesNoEnergyWhereProportionalPumps) {
  // to the side at small depth, in, back to the line, out (the path of `clamp_pump`)
  const auto cycle = [](ClampingMode mode) {
    const Site site = defaultSite();
    const auto at = [&](double depth, double aside) {
      return site.p_surface_m + site.inward * depth + site.across_1 * aside;
    };
    MotionBuilder builder(4000, at(-0.002, 0), site.inward);
    builder.moveTo(at(0.012, 0), 0.3).moveTo(at(0.012, 0.0099), 0.5).moveTo(at(0.03, 0.0099), 0.8);
    builder.moveTo(at(0.03, 0), 0.5).moveTo(at(-0.002, 0), 0.8);
    const Motion motion = builder.take();
    EngineRun run(clampingScene(10'000, mode), 4000);
    return forceWork(motion, run.run(motion));
  };
  EXPECT_LE(cycle(ClampingMode::kConservative), 1e-5);
  EXPECT_GT(cycle(ClampingMode::kProportional), 1e-3) << "the negative control: eq. 8 taken literally";
}

TEST(Clamping, forceIsCappedAndFlagged) {
  Probe probe(clampingScene(10'000, ClampingMode::kProportional, 0.5), 1000);
  probe.at(-1e-4);
  probe.go(300, 0.03);
  probe.at(0.03, 0.004);  // k = 300 N/m
  EXPECT_NEAR(probe.last().clamping_N, 0.5, 1e-12);
  EXPECT_TRUE(probe.last().flags & kFlagClampCapped);
}

// u turns until the tip is β beside it, but never past the needle's axis
TEST(Clamping, aTipAsideTurnsTheTrajectoryAsFarAsTheNeedlePoints) {
  const SceneSpec scene = clampingScene(10'000, ClampingMode::kConservative, 0.5);
  const double r = std::hypot(0.02, 0.006), to_beta = std::atan2(0.006, 0.02) - holdAngle(scene, r);
  ASSERT_GT(to_beta, 0.15);
  for (const double axis : {-0.1, 0.0, 0.05, 0.1, 0.5}) {
    Probe probe(scene, 1000);
    probe.at(-1e-4);
    probe.go(300, 0.02);
    probe.tilt(axis);
    probe.go(1000, 0.02, 0.006);
    probe.stay(500);
    EXPECT_NEAR(angleOf(probe.state().u_W, probe.site().inward), std::clamp(axis, 0.0, to_beta), 1e-6);
    EXPECT_NEAR(norm(probe.state().u_W), 1.0, 1e-12);
  }
}

TEST(Clamping, theTurnIsNeverFasterThanTwoRadiansASecond) {
  for (const double rate_hz : {500.0, 1000.0}) {
    Probe probe(clampingScene(20'000, ClampingMode::kProportional, 0.1), rate_hz);
    probe.at(-1e-4);
    probe.go(100, 0.01);
    probe.tilt(0.9);
    Vec3 before = probe.state().u_W;
    bool at_limit = false;
    for (int i = 0; i < 100; ++i) {
      probe.go(1, 0.01, 0.0001 * (i + 1));
      const double angle = angleOf(probe.state().u_W, before);
      ASSERT_LE(angle, 2.0 / rate_hz + 1e-12);
      at_limit = at_limit || std::abs(angle - 2.0 / rate_hz) < 1e-12;
      before = probe.state().u_W;
    }
    EXPECT_TRUE(at_limit);
  }
}

TEST(Clamping, theConeHoldsTheTurnBack) {
  const SceneSpec scene = clampingScene(20'000, ClampingMode::kProportional, 0.1);
  Probe probe(scene, 1000);
  probe.at(-1e-4);
  probe.go(300, 0.03);
  probe.tilt(1.2);
  bool bound = false;
  double before = 0;
  for (const auto& report : probe.go(1500, 0.03, 0.04)) {
    const double angle = angleOf(probe.state().u_W, probe.state().u0_W);
    const double cone = orientationLimitAngle(scene.needle_length_m, report.insertion_m);
    ASSERT_LE(angle, std::max(cone, before) + 1e-12);
    bound = bound || std::abs(angle - cone) < 1e-9;
    before = angle;
  }
  EXPECT_TRUE(bound) << "the test must get to the cone";
}

// "Change of trajectory": "w, the friction wall, the places of membranes and the remembered values of x …
// move by x_new − x_old, so that no force jumps."
TEST(Clamping, aTurnMakesNoForceJump) {
  SceneSpec scene = allEffects();
  scene.virtual_fixture.max_force_N = 0.5;
  scene.virtual_fixture.mode = ClampingMode::kConservative;
  Probe probe(scene, 1000);
  probe.at(-1e-4);
  probe.go(700, 0.02);
  probe.tilt(0.8);
  StepReport before = probe.at(0.02);
  int turns = 0;
  for (int i = 1; i <= 500; ++i) {
    const StepReport report = probe.at(0.02, 0.02 * i / 500);
    if (report.flags & kFlagTurn) {
      ++turns;
      const double step = 0.02 / 500, sum_K = 500 + 140 + report.clamping_stiffness_N_per_m + 300;
      ASSERT_LE(std::abs(report.cutting_N + report.attracted_N - before.cutting_N - before.attracted_N),
                500 * step + 3e-3);
      ASSERT_LE(norm(report.wrench_W.force_N - before.wrench_W.force_N), sum_K * step / 0.7 + 3e-3);
      ASSERT_LE(std::abs(report.speed_mps - before.speed_mps), 2 * step / 0.1 + 1e-9)
          << "past positions moved as well";
    }
    before = report;
  }
  EXPECT_GT(turns, 50);
}

}  // namespace
}  // namespace needlelab::test
