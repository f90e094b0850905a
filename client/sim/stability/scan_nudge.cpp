#include "client/sim/stability/scan_nudge.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "client/sim/stability/closed_loop_case.h"

namespace needlelab {
namespace {

constexpr double kStart_m = 0.002;  // above the skin
constexpr double kTap_s = 0.02;     // there and back
constexpr double kPressSpeed_mps = 0.005;

// peak-to-peak of the sine that has the same RMS: one beat more or less does not change it
class Swing {
 public:
  void add(double value) {
    sum_ += value * value;
    ++n_;
  }
  [[nodiscard]] double value() const { return n_ > 0 ? 2 * std::sqrt(2 * sum_ / n_) : 0; }

 private:
  double sum_ = 0, n_ = 0;
};

// where the needle goes on the whole: the mean over the time around a tick
class SlowPart {
 public:
  explicit SlowPart(const PlantRun& run)
      : reach_(static_cast<std::size_t>(kReach_s * run.rate_hz + 0.5)), sum_m_(run.ticks.size() + 1, 0.0) {
    for (std::size_t i = 0; i < run.ticks.size(); ++i) sum_m_[i + 1] = sum_m_[i] + run.ticks[i].p_W_m.z;
  }
  [[nodiscard]] double at(std::size_t i) const {
    const std::size_t reach = std::min({reach_, i, sum_m_.size() - 2 - i});
    return (sum_m_[i + reach + 1] - sum_m_[i - reach]) / static_cast<double>(2 * reach + 1);
  }

 private:
  static constexpr double kReach_s = 0.15;  // more than half of the slowest swing, 5 Hz
  std::size_t reach_;
  std::vector<double> sum_m_;
};

// slope of force over depth, by least squares
class Slope {
 public:
  void add(double depth_m, double force_N) {
    ++n_;
    const double from_mean = depth_m - mean_m_;
    mean_m_ += from_mean / n_;
    mean_N_ += (force_N - mean_N_) / n_;
    sum_xx_ += from_mean * (depth_m - mean_m_);
    sum_xy_ += from_mean * (force_N - mean_N_);
  }
  [[nodiscard]] double value() const { return sum_xx_ > 0 ? sum_xy_ / sum_xx_ : 0; }

 private:
  double n_ = 0, mean_m_ = 0, mean_N_ = 0, sum_xx_ = 0, sum_xy_ = 0;
};

NudgeOutcome outcomeOf(const PlantRun& run, TimeWindow watch, double encoder_step_m) {
  NudgeOutcome outcome;
  outcome.finite = allFinite(run);
  outcome.fault = run.fault;
  if (run.ticks.empty()) return outcome;
  const SlowPart slow(run);
  Swing first, middle, end;
  std::vector<double> end_N;
  Slope wall;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const PlantTick& tick = run.ticks[i];
    const double share = (tick.time_s - watch.from_s) / (watch.to_s - watch.from_s);
    if (share < 0) continue;
    const double swing = tick.p_W_m.z - slow.at(i), resistance_N = tick.report.wrench_W.force_N.z;
    wall.add(-tick.seen.p_WT_m.z, resistance_N);
    if (share < 1.0 / 3) first.add(swing);
    if (share >= 0.3 && share < 0.5) middle.add(swing);
    if (share >= 0.75 && share < 0.95) end.add(swing), end_N.push_back(resistance_N);
  }
  outcome.swing_first_m = first.value();
  outcome.swing_middle_m = middle.value();
  outcome.swing_end_m = end.value();
  outcome.force_end_N = peakToPeak(end_N);
  outcome.wall_N_per_m = wall.value();
  outcome.stable = isStable(outcome, encoder_step_m);
  return outcome;
}

}  // namespace

NudgeOptions nudgeOptionsOf(CaseEntry& entry) {
  NudgeOptions options;
  options.press_N = entry.number("press_n", 0.01, 10);
  options.settle_s = entry.number("settle_s", 0.01, 60);
  options.nudge_mps = entry.number("nudge_m_s", 1e-4, 0.5);
  options.watch_s = entry.number("watch_s", 0.5, 60);
  return options;
}

bool isStable(const NudgeOutcome& outcome, double encoder_step_m) {
  if (!outcome.finite || outcome.fault != Fault::kNone) return false;
  return outcome.swing_end_m <= kRestEncoderSteps * encoder_step_m ||
         outcome.swing_end_m <= 0.95 * outcome.swing_middle_m;
}

Result<NudgeRun> nudge(const ForceSourceFactory& source, const SceneSpec& scene, double stiffness_N_per_m,
                       const PlantOptions& plant, const NudgeOptions& options) {
  // where hand and wall hold each other at `press_N`
  const HandOptions& hand = plant.device.hand;
  const double depth_m = options.press_N * (1 / stiffness_N_per_m + 1 / hand.stiffness_N_per_m);
  // the tap is a triangle in the hand's aim: the spring's impulse is k·height·time/2, the damper's cancels
  const double impulse_Ns = plant.device.limits.apparent_mass_kg * options.nudge_mps;
  const double tap_m = 2 * impulse_Ns / (hand.stiffness_N_per_m * kTap_s);

  const Quat down = orientationAlong(kInward_W);
  const auto at = [&](double z_m) { return Pose{{0, 0, z_m}, down}; };
  HandPlan plan(at(kStart_m));
  plan.hold(0.3).moveTo(at(-depth_m), kPressSpeed_mps, Motion::kMinJerk).hold(options.settle_s);
  plan.moveIn(at(-depth_m - tap_m), kTap_s / 2, Motion::kLinear)
      .moveIn(at(-depth_m), kTap_s / 2, Motion::kLinear);
  const TimeWindow watch{plan.duration_s(), plan.duration_s() + options.watch_s};
  plan.hold(options.watch_s);

  auto run = runScene(source, scene, plan, plant);
  if (!run.ok()) return run.error();
  const NudgeOutcome outcome = outcomeOf(*run, watch, plant.device.encoder_step_m);
  return NudgeRun{*std::move(run), watch, outcome};
}

}  // namespace needlelab
