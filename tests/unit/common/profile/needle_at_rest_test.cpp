// A needle at rest in the samples whose model drags a wall: what tissue pushes with, what a needle does that
// is let go, and that going on meets the tissue again (FORCE_MODEL.md, "Stop", "Shaft friction").
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/haptics/engine.h"
#include "tests/unit/common/profile/sample_scenes.h"

namespace needlelab::needle_at_rest {
namespace {

constexpr double kRate_hz = 1000, kTick_s = 1 / kRate_hz;

struct Sample {
  std::string name;
  std::shared_ptr<const SceneModel> model;
  double rejection_N = 0;       ///< the greatest of a layer
  std::vector<double> rests_m;  ///< depths in the middle of layers
  std::vector<double> roomy_m;  ///< … and such with 5.5 mm of the same layer beyond, whose spring is shorter
};

// straight in under a plane of skin, without what else holds a needle at rest: membranes, bone, hub
std::vector<Sample> samples() {
  std::vector<Sample> found;
  for (auto [name, spec] : test::sampleScenes()) {
    if (spec.axial_model != AxialModel::kEnhancedTrackingWall) continue;
    if ((spec.effects & bitOf(Effect::kCutting)) == 0) continue;
    spec.limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
    spec.bone_normal.reset();
    spec.effects &= ~(bitOf(Effect::kPuncture) | bitOf(Effect::kBone) | bitOf(Effect::kHub));
    Sample one{name, nullptr, 0, {}, {}};
    double depth_m = 0;
    for (const LayerSpec& layer : spec.layers) {
      one.rejection_N = std::max(one.rejection_N, layer.rejection_force_N);
      if (const double at_m = depth_m + 0.6 * layer.thickness_m; at_m > 2e-3 && at_m < 0.05)
        one.rests_m.push_back(at_m);
      if (layer.thickness_m > 0.008 && layer.cutting_force_N / spec.tracking_wall.stiffness_N_per_m < 5e-3)
        one.roomy_m.push_back(depth_m + layer.thickness_m - 0.006);
      depth_m += layer.thickness_m;
    }
    auto model = compile(spec, kRate_hz);
    EXPECT_TRUE(model.ok()) << one.name;
    one.model = std::make_shared<SceneModel>(std::move(*model));
    found.push_back(std::move(one));
  }
  EXPECT_GE(found.size(), 15u);
  return found;
}

class Needle {
 public:
  explicit Needle(const SceneModel& model) : model_(model), state_(std::make_unique<SimState>()) {
    for (int i = 0; i < 3; ++i) at(-0.002);
  }
  /// Along the needle, inward is positive; returns the force inward.
  double at(double depth_m) {
    depth_m_ = depth_m;
    step(model_, {{0, 0, -depth_m}, {1, 0, 0, 0}}, *state_, report_);
    return -report_.wrench_W.force_N.z;
  }
  double to(double depth_m, double speed_mps = 0.02) {
    const double from_m = depth_m_;
    const int ticks = std::max(1, static_cast<int>(std::fabs(depth_m - from_m) / speed_mps * kRate_hz));
    double force_N = 0;
    for (int i = 1; i <= ticks; ++i) {
      const double next_m = from_m + (depth_m - from_m) * i / ticks, before_m = depth_m_;
      force_N = at(next_m);
      work_J_ += force_N * (next_m - before_m);
    }
    return force_N;
  }
  double rest(double seconds) {
    for (int i = 1; i < seconds * kRate_hz; ++i) at(depth_m_);
    return at(depth_m_);
  }
  /// How far a handle of 0.35 kg and 1.7 N·s/m goes within a second, let go.
  double letGo() {
    double speed_mps = 0, force_N = at(depth_m_), most_m = 0;
    const double from_m = depth_m_;
    for (int i = 0; i < kRate_hz; ++i) {
      speed_mps += (force_N - 1.7 * speed_mps) / 0.35 * kTick_s;
      force_N = at(depth_m_ + speed_mps * kTick_s);
      most_m = std::max(most_m, std::fabs(depth_m_ - from_m));
    }
    return most_m;
  }
  double takeWork_J() { return std::exchange(work_J_, 0.0); }
  [[nodiscard]] const StepReport& report() const { return report_; }

 private:
  const SceneModel& model_;
  std::unique_ptr<SimState> state_;
  StepReport report_;
  double depth_m_ = 0, work_J_ = 0;
};

// 0.50 and 0.74 N of 0.10 before; after a withdrawal 0.28 N inward
TEST(NeedleAtRest, tissuePushesWithTheRejectionForceAtMostAndNeverPullsIn) {
  for (const Sample& sample : samples())
    for (const double depth_m : sample.rests_m)
      for (const double back_m : {0.0, 0.001, 0.004}) {
        Needle needle(*sample.model);
        needle.to(depth_m + back_m);
        if (back_m > 0) needle.to(depth_m);
        const double inward_N = needle.rest(3);
        EXPECT_LE(inward_N, 1e-3) << sample.name << ", " << depth_m << " m, back " << back_m;
        EXPECT_GE(inward_N, -sample.rejection_N - 1e-3)
            << sample.name << ", " << depth_m << " m, back " << back_m;
      }
}

// 3.9 mm in 0.1 s and 6.1 mm in 0.3 s before
TEST(NeedleAtRest, letGoItStays) {
  for (const Sample& sample : samples())
    for (const double depth_m : sample.rests_m)
      for (const double back_m : {0.0, 0.003}) {
        Needle needle(*sample.model);
        needle.to(depth_m + back_m);
        if (back_m > 0) needle.to(depth_m);
        needle.rest(2);
        EXPECT_LE(needle.letGo(), 0.5e-3) << sample.name << ", " << depth_m << " m, back " << back_m;
      }
}

// "5 mm beyond a rest work and force are within 5 % of those without it, less the energy that it let go"
TEST(NeedleAtRest, whoGoesOnMeetsTheTissueAgain) {
  for (const Sample& sample : samples())
    for (const double depth_m : sample.roomy_m) {
      double force_N[2], work_J[2], let_go_J = 0;
      for (const int rests : {0, 1}) {
        Needle needle(*sample.model);
        needle.to(depth_m);
        needle.takeWork_J();
        if (rests == 1) {
          const auto energy = [&] {
            const double wall_N = needle.report().cutting_N + needle.report().attracted_N;
            const double rubs_N = needle.report().friction_N, rubs = sample.model->friction_stiffness_N_per_m;
            return wall_N * wall_N / (2 * sample.model->axial_stiffness_N_per_m) +
                   (rubs > 0 ? rubs_N * rubs_N / (2 * rubs) : 0);
          };
          const double before_J = energy();
          needle.rest(2);
          let_go_J = before_J - energy();
        }
        force_N[rests] = needle.to(depth_m + 0.0055);
        work_J[rests] = needle.takeWork_J();
      }
      EXPECT_NEAR(force_N[1], force_N[0], 0.05 * std::fabs(force_N[0])) << sample.name << ", " << depth_m;
      EXPECT_NEAR(work_J[1], work_J[0] + let_go_J, 0.05 * std::fabs(work_J[0]))
          << sample.name << ", " << depth_m;
    }
}

// 9.9 mm before
TEST(NeedleAtRest, aNeedleThatTurnsRoundIsPulledInFullWithinSixMillimetres) {
  for (const Sample& sample : samples()) {
    if (sample.name.starts_with("paper") || sample.roomy_m.empty()) continue;  // the paper's own walls
    const double depth_m = sample.roomy_m.back();
    Needle needle(*sample.model), further(*sample.model);
    needle.to(depth_m);
    further.to(depth_m + 0.02);
    const double pulled_N = needle.to(depth_m - 0.006);
    if (needle.report().depth_m < 0.002) continue;
    EXPECT_NEAR(pulled_N, further.to(depth_m - 0.006), 0.05 * std::fabs(pulled_N)) << sample.name;
  }
}

}  // namespace
}  // namespace needlelab::needle_at_rest
