// The line of a needle over all samples and bodies, by what a hand does and by the paper (FORCE_MODEL.md,
// "Near the skin", "Change of trajectory"): not by the engine's own page.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "common/haptics/body/body_engine.h"
#include "tests/support/random.h"
#include "tests/support/run_form.h"
#include "tests/unit/common/profile/sample_scenes.h"

namespace needlelab::line_of_a_needle {
namespace {

constexpr double kRate_hz = 1000, kSpeed_mps = 0.02, kDegree = std::numbers::pi / 180;

struct Patient {
  std::string name;
  SceneSpec scene;
  std::shared_ptr<const SceneModel> model;
  Vec3 inward, across, other;  ///< the planned direction from the origin
  double deep_m = 0;           ///< 40 mm, or as far as the needle is long
  bool is_body = false;
};

// every sample with a fixture, without bone: its line is judged at depths where some have bone
const std::vector<Patient>& patients() {
  static const std::vector<Patient> all = [] {
    std::vector<Patient> found;
    for (const auto& [name, scene] : test::sampleScenes(true)) {
      if ((scene.effects & bitOf(Effect::kClamping)) == 0 || name == "paper-clamping") continue;
      Patient one;
      one.name = name;
      one.scene = scene;
      one.scene.effects &= ~bitOf(Effect::kBone);
      one.is_body = std::holds_alternative<BodyLimb>(one.scene.limb);
      one.inward = {0, 0, -1};
      one.across = {1, 0, 0};
      one.other = cross(one.inward, one.across);
      one.deep_m = std::min(0.04, 0.9 * one.scene.needle_length_m);
      auto model = compile(one.scene, kRate_hz);
      EXPECT_TRUE(model.ok()) << one.name;
      one.model = std::make_shared<SceneModel>(std::move(*model));
      found.push_back(std::move(one));
    }
    std::sort(found.begin(), found.end(), [](const Patient& a, const Patient& b) { return a.name < b.name; });
    EXPECT_EQ(found.size(), 25u);
    return found;
  }();
  return all;
}

// a needle that is moved from place to place; depth along the planned direction, and two distances across
class Needle {
 public:
  explicit Needle(const Patient& patient)
      : patient_(patient), engine_(*patient.model), axis_(patient.inward) {
    for (int i = 0; i < 60; ++i) at({-0.004, 0, 0});  // a body finds its first path
  }
  struct Place {
    double depth_m = 0, across_m = 0, other_m = 0;
  };
  const StepReport& at(Place place) {
    place_ = place;
    engine_.step({placeOf(place), rotationTo(axis_)}, report_);
    return report_;
  }
  const StepReport& to(Place place, double speed_mps = kSpeed_mps) {
    const Place from = place_;
    const double way_m = std::hypot(place.depth_m - from.depth_m, place.across_m - from.across_m,
                                    place.other_m - from.other_m);
    const int ticks = std::max(1, static_cast<int>(way_m / speed_mps * kRate_hz));
    for (int i = 1; i <= ticks; ++i) {
      const double s = static_cast<double>(i) / ticks;
      at({from.depth_m + (place.depth_m - from.depth_m) * s,
          from.across_m + (place.across_m - from.across_m) * s,
          from.other_m + (place.other_m - from.other_m) * s});
    }
    return report_;
  }
  void point(Vec3 axis) { axis_ = axis; }
  [[nodiscard]] Vec3 placeOf(Place p) const {
    return patient_.inward * p.depth_m + patient_.across * p.across_m + patient_.other * p.other_m;
  }
  [[nodiscard]] const StepReport& report() const { return report_; }
  [[nodiscard]] const SimState& state() const { return engine_.state(); }
  /// The force across the planned direction.
  [[nodiscard]] Vec3 sideways_N() const {
    const Vec3 force = report_.wrench_W.force_N;
    return force - patient_.inward * dot(force, patient_.inward);
  }

 private:
  static Quat rotationTo(Vec3 axis) {  // the shortest from −z
    const Vec3 half = normalized(axis + Vec3{0, 0, -1}), about = cross({0, 0, -1}, half);
    return Quat{about.x, about.y, about.z, dot({0, 0, -1}, half)} * Quat{1, 0, 0, 0};
  }
  const Patient& patient_;
  SceneEngine engine_;
  Vec3 axis_;
  Place place_;
  StepReport report_;
};

// a smooth wander of 0.5 mm rms
struct Wander {
  explicit Wander(std::uint64_t seed) {
    test::Random random(seed);
    for (double& f : hz) f = random.in(0.3, 3);
    for (double& p : phase) p = random.in(0, 2 * std::numbers::pi);
  }
  double hz[6], phase[6];
  [[nodiscard]] double at(double t_s, int axis) const {
    double sum = 0;
    for (int i = 0; i < 3; ++i)
      sum += std::sin(2 * std::numbers::pi * hz[3 * axis + i] * t_s + phase[3 * axis + i]);
    return 0.5e-3 / std::sqrt(3.0) * sum;  // over both axes
  }
};

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

int handsOf(const Patient& patient) {
  return patient.is_body && !test::longForm() ? 3 : 24;
}

// "a straight needle keeps a straight line": 2.09 N and 3.8 mm before
TEST(LineOfANeedle, aHandThatWandersWithAStraightAxisIsHeldToItsOwnLine) {
  for (const Patient& patient : patients()) {
    std::vector<double> clamping_N, led_m;
    for (int hand = 0; hand < handsOf(patient); ++hand) {
      const Wander wander(static_cast<std::uint64_t>(hand) + 1);
      Needle open(patient), closed(patient);
      // closed: a hand of 300 N/m and 5 N·s/m holds 0.35 kg across the needle, whose force is one tick late
      double place_m[2] = {wander.at(0, 0), wander.at(0, 1)}, speed_mps[2] = {0, 0};
      Vec3 force_N;
      const int ticks = static_cast<int>((patient.deep_m + 0.004) / kSpeed_mps * kRate_hz);
      for (int k = 0; k <= ticks; ++k) {
        const double t_s = k / kRate_hz, depth_m = -0.004 + kSpeed_mps * t_s;
        const double want_m[2] = {wander.at(t_s, 0), wander.at(t_s, 1)};
        open.at({depth_m, want_m[0], want_m[1]});
        const double got_N[2] = {dot(force_N, patient.across), dot(force_N, patient.other)};
        for (int i = 0; i < 2; ++i) {
          speed_mps[i] += (300 * (want_m[i] - place_m[i]) - 5 * speed_mps[i] + got_N[i]) / 0.35 / kRate_hz;
          place_m[i] += speed_mps[i] / kRate_hz;
        }
        closed.at({depth_m, place_m[0], place_m[1]});
        force_N = closed.report().wrench_W.force_N;
        if (k == ticks) led_m.push_back(std::hypot(want_m[0] - place_m[0], want_m[1] - place_m[1]));
      }
      clamping_N.push_back(open.report().clamping_N);
    }
    EXPECT_LE(median(clamping_N), 0.4) << patient.name;
    EXPECT_LE(median(led_m), 0.6e-3) << patient.name;
  }
}

// eq. 8: k(d) times the millimetre, back to the line, wherever the drift was
TEST(LineOfANeedle, aDriftWithAStraightAxisGoesBackAsEq8) {
  for (const Patient& patient : patients())
    for (const double at_m : {0.0015, 0.002, 0.003, 0.006, 0.01}) {
      if (at_m > 0.5 * patient.deep_m) continue;
      Needle needle(patient);
      needle.to({at_m});
      needle.to({at_m, 0.001}, 0.01);
      const StepReport& report = needle.to({patient.deep_m, 0.001});
      EXPECT_NEAR(report.lateral_error_m, 1e-3, 0.05e-3) << patient.name << ", " << at_m;
      const double right_N = -report.clamping_stiffness_N_per_m * 1e-3;
      EXPECT_NEAR(dot(needle.sideways_N(), patient.across), right_N, 0.05 * -right_N + 0.005)
          << patient.name << ", " << at_m;
    }
}

// −2.16 and +1.42 N before
TEST(LineOfANeedle, theSamePoseHasTheSameSidewaysForceWhateverTheWay) {
  for (const Patient& patient : patients()) {
    if (patient.deep_m < 0.02) continue;
    std::vector<Vec3> forces;
    const int ways = patient.is_body && !test::longForm() ? 3 : 12;
    for (int way = 0; way < ways; ++way) {
      test::Random random(static_cast<std::uint64_t>(way) + 100);
      Needle needle(patient);
      needle.to({0.001});
      for (int leg = 0; leg < (way == 0 ? 0 : 6); ++leg) {
        const double depth_m = random.in(0.0015, 0.8 * patient.deep_m);
        const double aside_m = std::min(0.002, 2.5 * (depth_m - 0.001));
        needle.to({depth_m, random.in(-aside_m, aside_m), random.in(-aside_m, aside_m)}, 0.04);
      }
      needle.to({0.6 * patient.deep_m, 0.001, 0.0005}, 0.04);
      needle.to({patient.deep_m, 0.001, 0.0005});
      forces.push_back(needle.sideways_N());
    }
    for (const Vec3& force : forces) EXPECT_LE(norm(force - forces.front()), 0.1) << patient.name;
  }
}

// re-aimed by 10° about the hole, then in along the needle: 2.08 N from 6 mm on before
TEST(LineOfANeedle, aReAimIsFreeNearTheSkinAndNeverFreerDeeper) {
  for (const Patient& patient : patients()) {
    double before_N = 0;
    for (const double at_m : {0.0005, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.008, 0.012, 0.018, 0.025}) {
      if (at_m > 0.6 * patient.deep_m) continue;
      Needle needle(patient);
      needle.to({at_m});
      const auto aimed = [&](double degrees) {
        return patient.inward * std::cos(degrees * kDegree) + patient.across * std::sin(degrees * kDegree);
      };
      for (int i = 1; i <= 500; ++i) {
        const double degrees = 10.0 * i / 500;
        needle.point(aimed(degrees));
        needle.at({at_m * std::cos(degrees * kDegree), at_m * std::sin(degrees * kDegree)});
      }
      for (int i = 0; i < 200; ++i) needle.at({at_m * std::cos(10 * kDegree), at_m * std::sin(10 * kDegree)});
      const double force_N =
          needle.to({patient.deep_m * std::cos(10 * kDegree), patient.deep_m * std::sin(10 * kDegree)})
              .clamping_N;
      if (patient.scene.needle_length_m >= 0.05) {
        EXPECT_LE(force_N, at_m <= 0.005 ? 0.3 : at_m <= 0.008 ? 1.0 : 4.0) << patient.name << ", " << at_m;
      }
      EXPECT_GE(force_N, before_N - 0.005) << patient.name << ", " << at_m << " m: the deeper, the less free";
      before_N = force_N;
    }
    EXPECT_GT(before_N, 0.05) << patient.name;
  }
}

// 0.5° rms of noise in the axis and 50 µm in the tip, for 10 s, with the tip 1 mm off the line
TEST(LineOfANeedle, noiseDoesNotTurnItAndDoesNotStepTheForce) {
  for (const Patient& patient : patients()) {
    if (patient.is_body && !test::longForm()) continue;
    for (const double depth_m : {0.002, 0.005, 0.012, 0.03}) {
      if (depth_m > patient.deep_m) continue;
      test::Random random(7);
      const auto noise = [&](double rms) {
        double sum = 0;
        for (int i = 0; i < 12; ++i) sum += random.in(-0.5, 0.5);
        return rms * sum;
      };
      Needle needle(patient);
      needle.to({depth_m});
      needle.to({depth_m, 0.001}, 0.01);
      for (int i = 0; i < 1500; ++i) needle.at({depth_m, 0.001});  // a stop relaxes it
      const Vec3 u_before = needle.state().u_W;
      const double springs_N_per_m =
          patient.model->axialStiffness_N_per_m() + patient.model->fixture_steepness.across_N_per_m;
      Vec3 force_before = needle.report().wrench_W.force_N, tip_before = needle.placeOf({depth_m, 0.001});
      double beyond_N = 0;
      for (int i = 0; i < 10'000; ++i) {
        const double tilt = 0.5 * kDegree / std::numbers::sqrt2;
        needle.point(normalized(patient.inward + patient.across * noise(tilt) + patient.other * noise(tilt)));
        const Needle::Place at{depth_m + noise(2e-5), 0.001 + noise(2e-5), noise(2e-5)};
        needle.at(at);
        const Vec3 force = needle.report().wrench_W.force_N, tip = needle.placeOf(at);
        if ((needle.report().flags & (kFlagRupture | kFlagLayerChange)) == 0)
          beyond_N =
              std::max(beyond_N, norm(force - force_before) - springs_N_per_m * norm(tip - tip_before));
        force_before = force;
        tip_before = tip;
      }
      const double turned =
          std::atan2(norm(cross(u_before, needle.state().u_W)), dot(u_before, needle.state().u_W));
      EXPECT_LE(turned, 1 * kDegree) << patient.name << ", " << depth_m;
      EXPECT_LE(beyond_N, 0.02) << patient.name << ", " << depth_m;
    }
  }
}

// closed loops of tip and axis, out of step with each other: nothing winds up
TEST(LineOfANeedle, aClosedLoopOfTipAndAxisGivesNothing) {
  for (const Patient& patient : patients()) {
    if (patient.is_body) continue;
    SceneSpec scene = patient.scene;
    scene.effects &= bitOf(Effect::kClamping) | bitOf(Effect::kOrientationLimit);
    Patient only = patient;
    only.model = std::make_shared<SceneModel>(*compile(scene, kRate_hz));
    for (const double depth_m : {0.003, 0.008, 0.02})
      for (const double lag : {0.0, 1.6, 3.1}) {
        if (depth_m > 0.8 * patient.deep_m) continue;
        Needle needle(only);
        needle.to({depth_m});
        constexpr int kTicks = 2000;
        double worst_J = 0;
        Vec3 tip_before = needle.placeOf({depth_m}), axis_before = patient.inward, force, torque;
        for (int loop = 0; loop < 4; ++loop) {
          double given_J = 0;
          for (int k = 1; k <= kTicks; ++k) {
            const double at = 2 * std::numbers::pi * k / kTicks, out = 1 - std::cos(at);
            const Needle::Place place{depth_m, 0.2 * depth_m * out, 0.2 * depth_m * std::sin(at)};
            const Vec3 axis = normalized(patient.inward + patient.across * (0.3 * (1 - std::cos(at - lag))) +
                                         patient.other * (0.3 * std::sin(at - lag)));
            const Vec3 tip = needle.placeOf(place);
            needle.point(axis);
            const Wrench now = (needle.at(place), needle.report().wrench_W);
            given_J += 0.5 * dot(force + now.force_N, tip - tip_before) +
                       0.5 * dot(torque + now.torque_Nm, cross(axis_before, axis));
            force = now.force_N;
            torque = now.torque_Nm;
            tip_before = tip;
            axis_before = axis;
          }
          if (loop > 0) worst_J = std::max(worst_J, given_J);  // the first begins elsewhere
        }
        EXPECT_LE(worst_J, 0.05e-3) << patient.name << ", " << depth_m << ", " << lag;
      }
  }
}

}  // namespace
}  // namespace needlelab::line_of_a_needle
