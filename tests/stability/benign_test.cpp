// What a station takes from nobody: in time (D ≤ 2 ticks, b ≥ 1.7 N·s/m) gestures keep their force; later,
// what cuts and ruptures keeps its force, though the springs are softer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tests/stability/patients.h"

namespace needlelab::benign {
namespace {

using late_goal::Patient;
using late_goal::patientOf;

struct Gesture {
  const char* name;
  std::function<void(HandPlan&, const Patient&)> go;
};

Pose at(const Patient& patient, double depth_m, double aside_m = 0, double lean_rad = 0) {
  const Vec3 in_W = -patient.out_W;
  const Vec3 aside_W = normalized(cross(in_W, std::fabs(in_W.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  return {patient.skin_W_m + in_W * depth_m + aside_W * aside_m,
          orientationAlong(in_W * std::cos(lean_rad) + aside_W * std::sin(lean_rad))};
}

const std::vector<Gesture>& gestures() {
  const auto in = [](HandPlan& plan, const Patient& of, double depth_m, double speed_mps) {
    plan.hold(0.3).moveTo(at(of, depth_m), speed_mps, Motion::kMinJerk);
  };
  static const std::vector<Gesture> all = {
      {"in, rest, out",
       [=](auto& plan, auto& of) {
         in(plan, of, 0.025, 0.03);
         plan.hold(1).moveTo(at(of, -0.01), 0.05, Motion::kMinJerk);
       }},
      {"quick in, quick out",
       [=](auto& plan, auto& of) {
         in(plan, of, 0.03, 0.15);
         plan.moveTo(at(of, -0.01), 0.2, Motion::kMinJerk);
       }},
      {"to and fro",
       [=](auto& plan, auto& of) {
         in(plan, of, 0.02, 0.03);
         for (int i = 0; i < 3; ++i)
           plan.moveTo(at(of, 0.012), 0.04, Motion::kMinJerk).moveTo(at(of, 0.024), 0.04, Motion::kMinJerk);
       }},
      {"aside and back",
       [=](auto& plan, auto& of) {
         in(plan, of, 0.03, 0.03);
         plan.moveTo(at(of, 0.03, 0.006), 0.03, Motion::kMinJerk)
             .hold(0.5)
             .moveTo(at(of, 0.03), 0.03, Motion::kMinJerk)
             .moveTo(at(of, -0.01), 0.05, Motion::kMinJerk);
       }},
      {"leans",
       [=](auto& plan, auto& of) {
         in(plan, of, 0.03, 0.03);
         plan.moveIn(at(of, 0.03, 0, 0.4), 0.5, Motion::kMinJerk)
             .moveIn(at(of, 0.03, 0, -0.4), 0.6, Motion::kMinJerk)
             .moveIn(at(of, 0.03), 0.5, Motion::kMinJerk);
       }},
      {"onto bone and off",
       [=](auto& plan, auto& of) {
         in(plan, of, 0.08, 0.05);
         plan.hold(0.5).moveTo(at(of, 0.03), 0.1, Motion::kMinJerk).hold(0.3);
       }},
  };
  return all;
}

PlantRun ran(const Patient& patient, const Gesture& gesture, PlantOptions options, bool lowered) {
  HandPlan plan(at(patient, -0.01));
  gesture.go(plan, patient);
  options.passivity = passivityOf(options);
  return late_goal::runOf(patient, plan, options, lowered).run;
}

TEST(BenignGestures, inTimeKeepTheirForce) {
  for (const char* name : late_goal::kPatients) {
    const Patient patient = patientOf(name);
    for (const Gesture& gesture : gestures())
      for (const double grip : {300.0, 90.0})
        for (const std::uint32_t delay : {1u, 2u}) {
          PlantOptions options;
          options.device.delay_ticks = delay;
          options.device.hand.stiffness_N_per_m = grip;
          options.device.hand.damping_Ns_per_m = grip / 100;
          const PlantRun run = ran(patient, gesture, options, true);
          double most_N = 0;
          for (const PlantTick& tick : run.ticks)
            most_N = std::max(most_N, norm(tick.report.wrench_W.force_N));
          EXPECT_LT(greatestDistortion_N(run), 0.01 * most_N)
              << name << ", " << gesture.name << ", grip " << grip << ", D " << delay;
        }
  }
}

// Later, the springs are softer, but what cuts and what ruptures keeps its force, where a layer is thicker
// than the rise needs.
TEST(LateForces, cuttingAndRuptureForcesAreThoseOfTheProfile) {
  for (const char* name : late_goal::kPatients) {
    const Patient patient = patientOf(name);
    const auto most = [&](bool lowered) {
      HandPlan plan(at(patient, -0.01));
      plan.hold(0.3).moveTo(at(patient, 0.028), 0.02, Motion::kLinear);
      PlantOptions options;
      options.device.delay_ticks = 4;
      options.device.hand.stiffness_N_per_m = 3000;
      options.device.hand.damping_Ns_per_m = 60;
      const late_goal::LateRun late = late_goal::runOf(patient, plan, options, lowered);
      if (lowered) EXPECT_LT(late.share, 0.65) << name;
      std::vector<double> found;
      std::vector<double> cuts;
      double membrane_N = 0, cutting_N = 0;
      std::int32_t layer = 0;
      for (const PlantTick& tick : late.run.ticks) {
        if ((tick.report.flags & kFlagRupture) != 0) found.push_back(std::exchange(membrane_N, 0));
        membrane_N = std::max(membrane_N, -tick.report.puncture_N);
        if (tick.report.layer != layer) {
          cuts.push_back(cutting_N);
          layer = tick.report.layer;
          cutting_N = 0;
        }
        cutting_N = std::max(cutting_N, -tick.report.cutting_N);
      }
      cuts.push_back(cutting_N);
      return std::pair(found, cuts);
    };
    const auto lowered = most(true), whole = most(false);
    ASSERT_EQ(lowered.first.size(), whole.first.size()) << name;
    ASSERT_EQ(lowered.second.size(), whole.second.size()) << name;
    EXPECT_GE(lowered.first.size(), 1u) << name;
    for (std::size_t i = 0; i < lowered.first.size(); ++i)
      EXPECT_NEAR(lowered.first[i], whole.first[i], 0.01 * whole.first[i]) << name << ", membrane " << i;
    int reached = 0;
    for (std::size_t i = 0; i < lowered.second.size(); ++i)
      for (const LayerSpec& layer : patient.scene.layers) {
        if (!(std::fabs(layer.cutting_force_N - whole.second[i]) < 1e-6) || layer.cutting_force_N == 0)
          continue;
        EXPECT_NEAR(lowered.second[i], layer.cutting_force_N, 0.01 * layer.cutting_force_N) << name;
        ++reached;
      }
    EXPECT_GE(reached, 2) << name;
  }
}

// What the control takes off comes and goes by at most 0.3 N a tick.
TEST(TakenForce, stepsByAtMostThreeTenthsOfANewton) {
  struct Loop {
    const char* name;
    double rate_hz;
    std::uint32_t delay_ticks;
    double grip_N_per_m, grip_Ns_per_m, lever_m;
    std::function<void(HandPlan&, const Patient&)> go;
  };
  const Loop loops[] = {
      {"200 Hz", 200, 1, 300, 3, 0,
       [](auto& plan, auto& of) {
         plan.hold(0.3).moveTo(at(of, 0.02), 0.03, Motion::kMinJerk);
         for (int i = 0; i < 4; ++i)
           plan.moveTo(at(of, 0.012), 0.05, Motion::kMinJerk).moveTo(at(of, 0.026), 0.05, Motion::kMinJerk);
         plan.hold(2);
       }},
      {"a light grip, late", 1000, 6, 90, 0.9, 0,
       [](auto& plan, auto& of) {
         plan.hold(0.3).moveTo(at(of, 0.025 + 3 / 90.0), 0.05, Motion::kMinJerk).hold(4);
       }},
      {"a fast wrist", 1000, 6, 300, 1, 0.1,
       [](auto& plan, auto& of) {
         plan.hold(0.3).moveTo(at(of, 0.03), 0.03, Motion::kMinJerk);
         for (int i = 0; i < 12; ++i)
           plan.moveIn(at(of, 0.03, 0, i % 2 == 0 ? 0.6 : -0.6), 1 / 6.0, Motion::kMinJerk);
       }},
  };
  int touched = 0;
  for (const char* name : late_goal::kPatients) {
    const Patient patient = patientOf(name);
    for (const Loop& loop : loops) {
      PlantOptions options;
      options.rate_hz = loop.rate_hz;
      options.device.delay_ticks = loop.delay_ticks;
      options.device.hand.stiffness_N_per_m = loop.grip_N_per_m;
      options.device.hand.damping_Ns_per_m = loop.grip_Ns_per_m;
      options.device.X_HT.p.z = loop.lever_m;
      const PlantRun run = ran(patient, {loop.name, loop.go}, options, false);
      double step_N = 0;
      for (std::size_t i = 1; i < run.ticks.size(); ++i)
        step_N = std::max(step_N, std::fabs(run.ticks[i].passivity_share - run.ticks[i - 1].passivity_share) *
                                      norm(run.ticks[i].report.wrench_W.force_N));
      touched += greatestDistortion_N(run) > 0.3;
      EXPECT_LE(step_N, 0.3 + 1e-9) << name << ", " << loop.name;
    }
  }
  EXPECT_GE(touched, 4) << "it has work to do";
}

}  // namespace
}  // namespace needlelab::benign
