// OKAMURA and DAHL by formula: force against depth, Karnopp's stick and slip, Dahl's hysteresis.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kSpring_N_per_m = 140;  // K_f
constexpr double kRest_mps = 0.003;      // v_stop

/// 10 mm with friction, and 190 mm below without: friction no longer changes with depth there.
SceneSpec rubbingSkin(AxialModel model, const ShaftFrictionSpec& in, const ShaftFrictionSpec& out) {
  SceneSpec scene = oneLayer(0, 0, 0);
  scene.axial_model = model;
  scene.effects = bitOf(Effect::kCutting);
  scene.needle_length_m = 0.2;
  scene.friction_stiffness_N_per_m = kSpring_N_per_m;
  scene.tracking_wall.stop_speed_mps = kRest_mps;
  scene.layers[0].thickness_m = 0.01;
  scene.layers.push_back(scene.layers[0]);
  scene.layers[1].thickness_m = 0.19;
  scene.layers[0].okamura = OkamuraSpec{500, 0, 1e-6, 0, in, out};
  scene.layers[1].okamura = OkamuraSpec{500, 0, 1e-6, 0, {}, {}};
  return scene;
}

/// Moves at a constant speed.
std::vector<StepReport> moveTo(Probe& probe, double& depth_m, double to_m, double speed_mps) {
  const int ticks =
      std::max(1, static_cast<int>(std::lround(std::abs(to_m - depth_m) / speed_mps * probe.rate_hz())));
  depth_m = to_m;
  return probe.go(ticks, to_m);
}

TEST(Okamura, quadraticStiffnessThenCuttingAndFriction) {
  for (const AxialModel model : {AxialModel::kOkamura, AxialModel::kDahl}) {
    SceneSpec scene = oneLayer(0, 0, 0);
    scene.axial_model = model;
    scene.effects = bitOf(Effect::kCutting);
    scene.layers[0].okamura = OkamuraSpec{100, 3e4, 0.7, 0.4, {12, 18.6, 293}, {10.6, 18.5, 212}};
    Probe probe(scene, 1000);
    double depth_m = -0.001;
    probe.at(depth_m);
    // until 100 z + 3e4 z² is 0.7 N, at 3.444 mm
    for (const StepReport& r : moveTo(probe, depth_m, 0.0034, 0.01)) {
      const double z_m = std::max(0.0, r.depth_m);
      EXPECT_NEAR(r.puncture_N, -(100 * z_m + 3e4 * z_m * z_m), 1e-12);
      EXPECT_EQ(r.cutting_N + r.friction_N, 0.0) << "nothing is cut or rubbed before the puncture";
    }
    EXPECT_TRUE(probe.at(0.00345).flags & kFlagRupture);
    EXPECT_EQ(probe.last().puncture_N, 0.0);
    depth_m = 0.00345;
    // kinetic and viscous friction a per length; Dahl's element lags behind the growing limit: with F = c x,
    // dF/dx = σ (1 − F/(a x)) gives c = a/(1 + a/σ)
    moveTo(probe, depth_m, 0.05, 0.02);
    EXPECT_NEAR(probe.last().cutting_N, -0.4, 1e-12);
    const double in_N_per_m = 12 + 293 * probe.last().speed_mps;
    if (model == AxialModel::kOkamura)
      EXPECT_NEAR(probe.last().friction_N, -in_N_per_m * 0.05, 1e-9);
    else
      EXPECT_NEAR(probe.last().friction_N, -in_N_per_m / (1 + in_N_per_m / kSpring_N_per_m) * 0.05, 1e-3);
    // outwards: no cutting, the other direction's friction
    moveTo(probe, depth_m, 0.03, 0.02);
    EXPECT_EQ(probe.last().cutting_N, 0.0);
    EXPECT_EQ(probe.last().attracted_N, 0.0);
    EXPECT_NEAR(probe.last().friction_N, (10.6 - 212 * probe.last().speed_mps) * 0.03, 1e-9)
        << axialModelName(model) << ": at its limit, which shrinks";
  }
}

TEST(Okamura, numbersThatCannotWorkAreRefusedByLayerAndName) {
  const ShaftFrictionSpec good{12, 18.6, 293}, weaker_at_rest{12, 11.9, 0};
  const auto refusal = [](const SceneSpec& scene) {
    const auto model = compile(scene, 1000);
    return model.ok() ? std::string() : model.error().message;
  };
  SceneSpec scene = rubbingSkin(AxialModel::kOkamura, good, good);
  EXPECT_EQ(refusal(scene), "");
  scene.layers[1].okamura->linear_N_per_m = 0;
  EXPECT_THAT(refusal(scene), AllOf(HasSubstr("layers[1].okamura"), HasSubstr("never be punctured")));
  EXPECT_THAT(refusal(rubbingSkin(AxialModel::kOkamura, weaker_at_rest, good)),
              AllOf(HasSubstr("layers[0].okamura.static_in_n_per_m"), HasSubstr("11.9 is below 12")));
  EXPECT_THAT(refusal(rubbingSkin(AxialModel::kOkamura, good, weaker_at_rest)),
              HasSubstr("layers[0].okamura.static_out_n_per_m"));
}

TEST(Okamura, sticksBelowTheSpeedOfRestAndSlipsAboveIt) {
  const ShaftFrictionSpec in{20, 40, 300}, out{15, 35, 200};
  Probe probe(rubbingSkin(AxialModel::kOkamura, in, out), 1000);
  double depth_m = -0.001;
  probe.at(depth_m);
  moveTo(probe, depth_m, 0.03, 0.02);
  const double kinetic_N = (20 + 300 * 0.02) * 0.01;
  EXPECT_NEAR(probe.last().friction_N, -kinetic_N, 1e-12) << "it slips: kinetic and viscous";

  // it stops: the viscous part fades with the speed until it sticks; then the spring stays as it is
  probe.stay(300);
  EXPECT_EQ(probe.last().speed_mps, 0.0);
  const double held_N = -probe.last().friction_N;
  EXPECT_NEAR(held_N, (20 + 300 * kRest_mps) * 0.01, 1e-3) << "static friction, 0.4 N, could hold more";
  // it creeps on at 1 mm/s: the spring stretches up to static friction and no further
  for (const StepReport& r : moveTo(probe, depth_m, 0.031, 0.001)) {
    const double spring_N = held_N + kSpring_N_per_m * (r.depth_m - 0.03);
    EXPECT_NEAR(r.friction_N, -std::min(spring_N, 40 * 0.01), 1e-9);
  }
  moveTo(probe, depth_m, 0.034, 0.001);
  EXPECT_NEAR(probe.last().friction_N, -40 * 0.01, 1e-12);

  // faster: it breaks away, and the force falls to kinetic and viscous friction, gradually
  double before_N = probe.last().friction_N, before_m = depth_m;
  bool fell = false;
  for (const StepReport& r : moveTo(probe, depth_m, 0.05, 0.02)) {
    EXPECT_LE(std::abs(r.friction_N - before_N), kSpring_N_per_m * (r.depth_m - before_m) + 1e-3)
        << r.depth_m;
    fell = fell || r.friction_N > before_N + 1e-6;
    before_N = r.friction_N, before_m = r.depth_m;
  }
  EXPECT_TRUE(fell);
  EXPECT_NEAR(probe.last().friction_N, -kinetic_N, 1e-12);

  // outwards: first the spring unloads, then it drags the other way
  probe.stay(300);
  const double rests_at_N = probe.last().friction_N;
  moveTo(probe, depth_m, 0.048, 0.001);
  EXPECT_NEAR(probe.last().friction_N, rests_at_N + kSpring_N_per_m * 0.002, 1e-9);
  moveTo(probe, depth_m, 0.04, 0.001);
  EXPECT_NEAR(probe.last().friction_N, 35 * 0.01, 1e-12) << "creeping: static";
  moveTo(probe, depth_m, 0.02, 0.02);
  EXPECT_NEAR(probe.last().friction_N, (15 + 200 * 0.02) * 0.01, 1e-12);
}

/// Back and forth between `low_m` and `low_m + way_m`, one second each way; returns the reports of the last
/// cycle.
std::vector<StepReport> lastCycle(const SceneSpec& scene, double rate_hz, double low_m, double way_m,
                                  int cycles) {
  Probe probe(scene, rate_hz);
  probe.at(-0.001);
  const int stroke = static_cast<int>(rate_hz);
  probe.go(stroke, low_m);
  std::vector<StepReport> reports;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    reports = probe.go(stroke, low_m + way_m);
    for (const StepReport& r : probe.go(stroke, low_m)) reports.push_back(r);
  }
  return reports;
}

TEST(DahlModel, theLoopsAreaIsItsClosedForm) {
  // F_c = 30 N/m · 10 mm; λ = F_c/σ; over a distance S to and fro the steady loop's area is
  // 2 F_c (S − 2 λ tanh(S/2λ)): from ±F_c tanh(S/2λ), F = F_c − (F_c + F_c tanh(S/2λ)) e^(−s/λ)
  constexpr double kLimit_N = 0.3, kLambda_m = kLimit_N / kSpring_N_per_m;
  const ShaftFrictionSpec side{30, 30, 0};
  for (const double way_m : {0.0005, 0.002, 0.005, 0.02}) {
    const auto loop = lastCycle(rubbingSkin(AxialModel::kDahl, side, side), 1000, 0.02, way_m, 30);
    double area_J = 0, max_N = 0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const StepReport &from = loop[i == 0 ? loop.size() - 1 : i - 1], &to = loop[i];
      area_J -= 0.5 * (from.friction_N + to.friction_N) * (to.depth_m - from.depth_m);
      max_N = std::max(max_N, std::abs(to.friction_N));
    }
    const double tanh = std::tanh(way_m / (2 * kLambda_m));
    EXPECT_NEAR(max_N, kLimit_N * tanh, 1e-6) << way_m;
    const double expected_J = 2 * kLimit_N * (way_m - 2 * kLambda_m * tanh);
    EXPECT_NEAR(area_J, expected_J, 1e-3 * expected_J) << way_m;
    EXPECT_GT(area_J, 0) << "the hand gives it";
  }
}

TEST(DahlModel, followsItsDifferentialEquationWithUnequalLimits) {
  const ShaftFrictionSpec in{30, 30, 0}, out{12, 12, 0};
  const auto loop = lastCycle(rubbingSkin(AxialModel::kDahl, in, out), 1000, 0.02, 0.008, 2);
  // dF/dx = σ (1 − sign(dx) F/limit), in steps of a hundredth of a tick; while F falls the limit is that of
  // F's sign
  double force_N = -loop.front().friction_N, worst_N = 0;
  for (std::size_t i = 1; i < loop.size(); ++i) {
    const double dx_m = (loop[i].depth_m - loop[i - 1].depth_m) / 100;
    for (int k = 0; k < 100; ++k) {
      const auto slope = [&](double f_N) {
        const double limit_N = (f_N > 0 || (f_N == 0 && dx_m > 0) ? 30 : 12) * 0.01;
        return kSpring_N_per_m * (1 - (dx_m > 0 ? f_N : -f_N) / limit_N);
      };
      const double half_N = force_N + 0.5 * dx_m * slope(force_N);
      force_N += dx_m * slope(half_N);
    }
    worst_N = std::max(worst_N, std::abs(force_N + loop[i].friction_N));
  }
  EXPECT_LT(worst_N, 1e-6);
}

TEST(DahlModel, doesNotDependOnTheLoopsRateOrTheSpeed) {
  const ShaftFrictionSpec in{30, 30, 0}, out{12, 12, 0};
  const SceneSpec scene = rubbingSkin(AxialModel::kDahl, in, out);
  const auto slow = lastCycle(scene, 250, 0.02, 0.004, 6), fast = lastCycle(scene, 4000, 0.02, 0.004, 6);
  ASSERT_EQ(16 * slow.size(), fast.size());
  for (std::size_t i = 0; i < slow.size(); ++i)
    EXPECT_NEAR(slow[i].friction_N, fast[16 * i + 15].friction_N, 1e-9) << i;
}

// neither late speed measurements nor limits that differ by direction give the hand energy
TEST(Okamura, itsFrictionNeverGivesMoreThanItsSpringHolds) {
  const ShaftFrictionSpec in{30, 60, 900}, out{12, 20, 400};
  for (const AxialModel model : {AxialModel::kOkamura, AxialModel::kDahl}) {
    Probe probe(rubbingSkin(model, in, out), 1000);
    double depth_m = -0.001, given_J = 0;
    probe.at(depth_m);
    moveTo(probe, depth_m, 0.03, 0.02);
    StepReport before = probe.last();
    for (int k = 0; k < 60; ++k) {
      // reversals at speeds from 1 to 60 mm/s
      const double to_m = 0.03 + (k % 2 == 0 ? 1 : -1) * 0.001 * (1 + k % 7);
      for (const StepReport& r : moveTo(probe, depth_m, to_m, 0.001 * (1 + 7 * (k % 9)))) {
        given_J += 0.5 * (before.friction_N + r.friction_N) * (r.depth_m - before.depth_m);
        before = r;
      }
      const double held_J = before.friction_N * before.friction_N / (2 * kSpring_N_per_m);
      const double max_J = 0.9 * 0.9 / (2 * kSpring_N_per_m);
      EXPECT_LE(given_J + held_J, max_J) << axialModelName(model) << ", stroke " << k;
    }
    EXPECT_LT(given_J, -0.01) << "it takes";
  }
}

TEST(Okamura, theStatesHashSeesTheWaySinceItStuck) {
  const ShaftFrictionSpec side{20, 40, 0};
  Probe probe(rubbingSkin(AxialModel::kOkamura, side, side), 1000);
  double depth_m = -0.001;
  probe.at(depth_m);
  moveTo(probe, depth_m, 0.03, 0.02);
  SimState other = probe.state();
  EXPECT_EQ(hashOf(other), hashOf(probe.state()));
  EXPECT_GT(other.slid_m, 0.02);
  other.slid_m += 1e-6;
  EXPECT_NE(hashOf(other), hashOf(probe.state()));
}

TEST(Okamura, aDeviceLearnsTheSteepestSlope) {
  const ShaftFrictionSpec side{20, 40, 0};
  EXPECT_NEAR(Probe(rubbingSkin(AxialModel::kOkamura, side, side), 1000).model().axialStiffness_N_per_m(),
              500 + kSpring_N_per_m, 1e-9);
  EXPECT_NEAR(Probe(rubbingSkin(AxialModel::kDahl, side, side), 1000).model().axialStiffness_N_per_m(),
              500 + 2 * kSpring_N_per_m, 1e-9)
      << "turned back at its limit";
  SceneSpec steep = rubbingSkin(AxialModel::kOkamura, {}, {});
  steep.layers[0].okamura->linear_N_per_m = 200;
  steep.layers[0].okamura->quadratic_N_per_m2 = 1e5;
  steep.layers[0].okamura->puncture_force_N = 2;
  EXPECT_NEAR(Probe(steep, 1000).model().axialStiffness_N_per_m(), std::sqrt(200 * 200 + 4e5 * 2), 1e-9);
}

}  // namespace
}  // namespace needlelab::test
