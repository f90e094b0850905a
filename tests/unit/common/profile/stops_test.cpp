// A stop eases the force once, and a needle that continues meets the tissue again, at any speed: over the
// samples whose model drags a wall (FORCE_MODEL.md, "Stop").
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "common/haptics/engine.h"
#include "tests/unit/common/profile/sample_scenes.h"

namespace needlelab {
namespace {

constexpr double kRate_hz = 1000, kTick_s = 1 / kRate_hz, kEncoder_m = 1e-5;
constexpr double kRest_s = 4, kOut_m = 0.002;

bool dragsAWall(AxialModel model) {
  return model == AxialModel::kEnhancedTrackingWall || model == AxialModel::kTrackingWall ||
         model == AxialModel::kStatistical || model == AxialModel::kPrecomputed;
}

struct Sample {
  std::string name;
  SceneSpec spec;
  double depth_m = 0;  ///< of the straight strokes: into the second last layer, at most 40 mm
};

// the scene with only forces along the needle, under a plane: the test is about the wall
std::vector<Sample> samplesWithAWall() {
  std::vector<Sample> found;
  for (auto [name, spec] : test::sampleScenes()) {
    if (!dragsAWall(spec.axial_model)) continue;
    spec.limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
    spec.bone_normal.reset();
    double depth_m = 0;
    for (const LayerSpec& layer : spec.layers)
      if (&layer != &spec.layers.back() || spec.layers.size() == 1) depth_m += layer.thickness_m;
    found.push_back({name, spec, std::min(0.04, depth_m - 1e-3)});
  }
  return found;
}

struct Tremor {
  double peak_m = 0, frequency_hz = 0;
  [[nodiscard]] double at(double t_s) const {
    return peak_m * std::sin(2 * std::numbers::pi * frequency_hz * t_s);
  }
};

// a needle straight in and out along −z, read by an encoder
class Stroke {
 public:
  Stroke(const SceneSpec& spec, Tremor tremor = {}) : tremor_(tremor) {
    auto model = compile(spec, kRate_hz);
    EXPECT_TRUE(model.ok());
    model_ = *model;
    at(-kOut_m);
  }
  void at(double depth_m) {
    depth_m_ = depth_m;
    const double tip_m = std::round((depth_m + tremor_.at(time_s_)) / kEncoder_m) * kEncoder_m;
    time_s_ += kTick_s;
    const double before_N = force_N();
    step(model_, {{0, 0, -tip_m}, {1, 0, 0, 0}}, *state_, report_);
    // the hand's work, with the tick's mean force
    work_J += 0.5 * (before_N + force_N()) * (tip_m - tip_m_);
    tip_m_ = tip_m;
    peak_N = std::max(peak_N, force_N());
    if (report_.phase == Phase::kStopped && before_ != Phase::kStopped) ++stops;
    before_ = report_.phase;
  }
  template <class Watch>
  void go(double to_m, double speed_mps, Watch&& watch) {
    const double from_m = depth_m_;
    const int ticks =
        std::max(1, static_cast<int>(std::lround(std::abs(to_m - from_m) / (speed_mps * kTick_s))));
    for (int i = 1; i <= ticks; ++i) {
      at(from_m + (to_m - from_m) * i / ticks);
      watch();
    }
  }
  void go(double to_m, double speed_mps) {
    go(to_m, speed_mps, [] {});
  }
  void rest(double seconds) {
    for (int i = 0; i < std::lround(seconds * kRate_hz); ++i) at(depth_m_);
  }
  /// Positive out of the tissue, acting on the hand.
  [[nodiscard]] double force_N() const { return report_.wrench_W.force_N.z; }
  [[nodiscard]] double alongWall_N() const { return -(report_.cutting_N + report_.attracted_N); }
  [[nodiscard]] const StepReport& report() const { return report_; }
  [[nodiscard]] const SimState& state() const { return *state_; }
  [[nodiscard]] double depth_m() const { return depth_m_; }
  [[nodiscard]] const SceneModel& model() const { return model_; }

  double work_J = 0, peak_N = 0;
  int stops = 0;

 private:
  Tremor tremor_;
  SceneModel model_;
  std::unique_ptr<SimState> state_ = std::make_unique<SimState>();
  StepReport report_;
  double depth_m_ = 0, tip_m_ = -kOut_m, time_s_ = 0;
  Phase before_ = Phase::kFree;
};

// the wall's largest force just after its spring is stretched again: a tremor stretches it fully within 0.5
// mm
class ProbeBeyond {
 public:
  void begin(double at_m, double reach_m, double sign) {
    *this = {};
    from_m_ = at_m + sign * reach_m;
    sign_ = sign;
  }
  void watch(const Stroke& stroke) {
    if (sign_ == 0 || done_) return;
    // a softer layer or a rupture releases force by itself: such a probe says nothing about the rest
    crossed_ = crossed_ || (stroke.report().flags & (kFlagLayerChange | kFlagRupture)) != 0;
    const double beyond_m = sign_ * (stroke.depth_m() - from_m_);
    if (beyond_m >= 0) force_N_ = std::max(force_N_, std::abs(stroke.alongWall_N()));
    done_ = beyond_m >= 0.5e-3;
  }
  /// Nothing if another layer was met before.
  [[nodiscard]] std::optional<double> force_N() const {
    if (!done_ || crossed_) return {};
    return force_N_;
  }

 private:
  double from_m_ = 0, sign_ = 0, force_N_ = 0;
  bool crossed_ = false, done_ = false;
};

struct Outcome {
  double work_J = 0, peak_N = 0;
  std::vector<std::optional<double>> after_N;  ///< one Δ beyond each rest
  int stops = 0;
};

double cutReach_m(const Stroke& stroke) {
  if (stroke.model().cut_reach == nullptr) return 0;
  auto state = std::make_unique<SimState>(stroke.state());  // because of the table's caches
  return stroke.model().cut_reach(stroke.model(), *state, stroke.depth_m());
}

// in with three rests or none; a rest at the turn; out
Outcome strokesAt(const Sample& sample, double speed_mps, bool rests, Tremor tremor = {}) {
  Stroke stroke(sample.spec, tremor);
  std::array<ProbeBeyond, 4> probes;
  std::size_t next = 0;
  const auto watch = [&] {
    for (ProbeBeyond& probe : probes) probe.watch(stroke);
  };
  for (const double share : {0.25, 0.5, 0.75}) {
    stroke.go(share * sample.depth_m, speed_mps, watch);
    if (!rests) continue;
    stroke.rest(kRest_s);
    probes.at(next++).begin(stroke.depth_m(), cutReach_m(stroke) + 0.2e-3, 1);
  }
  stroke.go(sample.depth_m, speed_mps, watch);
  stroke.rest(kRest_s);
  const LayerSpec& layer = sample.spec.layers[stroke.state().layer];
  const double out_m =
      (layer.rejection_force_N + layer.attracted_force_N) / sample.spec.tracking_wall.stiffness_N_per_m;
  probes.at(next).begin(stroke.depth_m(), out_m + 0.2e-3, -1);
  stroke.go(-kOut_m, speed_mps, watch);
  Outcome of{stroke.work_J, stroke.peak_N, {}, stroke.stops};
  for (const ProbeBeyond& probe : probes) of.after_N.push_back(probe.force_N());
  return of;
}

constexpr std::array<double, 7> kSpeeds_mps = {0.0005, 0.001, 0.002, 0.003, 0.004, 0.006, 0.02};

double shareAllowed(double speed_mps) {
  return speed_mps < 0.001 ? 0.1 : 0.05;
}

// work and force at `speed_mps` equal those at 10 mm/s
void expectTheSame(const Sample& sample, const Outcome& of, const Outcome& at_10, double speed_mps,
                   double tremor_hz = 0) {
  const std::string where =
      fmt::format("{} at {:g} mm/s, tremor of {:g} Hz: ", sample.name, speed_mps * 1e3, tremor_hz);
  const double share = shareAllowed(speed_mps);
  EXPECT_NEAR(of.work_J, at_10.work_J, share * at_10.work_J + 1e-6) << where << "work";
  for (std::size_t i = 0; i < of.after_N.size(); ++i) {
    if (!of.after_N[i] || !at_10.after_N[i]) continue;
    EXPECT_NEAR(*of.after_N[i], *at_10.after_N[i], share * *at_10.after_N[i] + 1e-9) << where << "rest " << i;
  }
}

TEST(Stops, aStrokeCostsTheSameAtAnySpeedWithAndWithoutRests) {
  std::size_t probed = 0;
  for (const Sample& sample : samplesWithAWall())
    for (const bool rests : {false, true}) {
      const Outcome at_10 = strokesAt(sample, 0.01, rests);
      for (const double speed : kSpeeds_mps)
        expectTheSame(sample, strokesAt(sample, speed, rests), at_10, speed);
      probed += static_cast<std::size_t>(std::count_if(at_10.after_N.begin(), at_10.after_N.end(),
                                                       [](const auto& force) { return force.has_value(); }));
    }
  EXPECT_GE(probed, 20u) << "a check of nothing";
}

TEST(Stops, tremorHidesNoTissue) {
  for (const Sample& sample : samplesWithAWall()) {
    const Outcome at_10 = strokesAt(sample, 0.01, true);
    for (const double frequency_hz : {4.0, 7.0, 12.0})
      for (const double speed : {0.0005, 0.001, 0.002, 0.004})
        expectTheSame(sample, strokesAt(sample, speed, true, {1e-4, frequency_hz}), at_10, speed,
                      frequency_hz);
  }
}

// the values that a score reads: continuing slowly after a rest cannot lower them
TEST(Stops, forcesAfterARestDoNotDependOnTheSpeed) {
  for (const Sample& sample : samplesWithAWall()) {
    std::array<double, 2> peak_N{};
    std::array<std::vector<double>, 2> mean_N;
    for (const std::size_t i : {0u, 1u}) {
      const double speed_mps = i == 0 ? 0.004 : 0.02;
      std::vector<double> sum_Nm(sample.spec.layers.size()), way_m(sample.spec.layers.size());
      Stroke stroke(sample.spec);
      stroke.go(0.25 * sample.depth_m, 0.02);
      stroke.rest(kRest_s);
      double before_m = stroke.depth_m();
      stroke.go(sample.depth_m, speed_mps, [&] {
        const auto layer = static_cast<std::size_t>(stroke.report().layer);
        sum_Nm.at(layer) += stroke.alongWall_N() * (stroke.depth_m() - before_m);
        way_m.at(layer) += stroke.depth_m() - before_m;
        before_m = stroke.depth_m();
      });
      peak_N.at(i) = stroke.peak_N;
      for (std::size_t layer = 0; layer < way_m.size(); ++layer)
        mean_N.at(i).push_back(way_m[layer] > 1e-3 ? sum_Nm[layer] / way_m[layer] : 0.0);
    }
    EXPECT_NEAR(peak_N[0], peak_N[1], 0.05 * peak_N[1] + 1e-9) << sample.name;
    for (std::size_t layer = 0; layer < mean_N[0].size(); ++layer)
      EXPECT_NEAR(mean_N[0][layer], mean_N[1][layer], 0.05 * std::abs(mean_N[1][layer]) + 0.005)
          << sample.name << ", layer " << layer;
  }
}

}  // namespace
}  // namespace needlelab
