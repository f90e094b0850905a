#include "client/sim/stability/scan_nudge.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "client/sim/stability/case.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/models/fem_needle.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

constexpr double kStart_m = 0.002;  // above the skin
constexpr double kTap_s = 0.02;     // back and forth
constexpr double kPressSpeed_mps = 0.005;

// Peak-to-peak of the sine with the same RMS, so that one beat more or less does not matter.
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

// The needle's drift: its mean over the time around a tick.
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
  static constexpr double kReach_s = 0.15;  // more than half a period of the slowest swing, 5 Hz
  std::size_t reach_;
  std::vector<double> sum_m_;
};

// Least-squares slope of force over depth.
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
  Swing middle, end;
  Slope wall;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const PlantTick& tick = run.ticks[i];
    const double share = (tick.time_s - watch.from_s) / (watch.to_s - watch.from_s);
    if (share < 0) continue;
    const double swing = tick.p_W_m.z - slow.at(i);
    wall.add(-tick.seen.p_WT_m.z, tick.report.wrench_W.force_N.z);
    if (share >= 0.3 && share < 0.5) middle.add(swing);
    if (share >= 0.75 && share < 0.95) end.add(swing);
  }
  outcome.swing_middle_m = middle.value();
  outcome.swing_end_m = end.value();
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
  // where hand and wall balance at `press_N`
  const HandOptions& hand = plant.device.hand;
  const double depth_m = options.press_N * (1 / stiffness_N_per_m + 1 / hand.stiffness_N_per_m);
  // the tap is a triangle in the hand's aim: the spring's impulse is k·height·time/2, and the damper's
  // cancels out
  const double impulse_Ns = plant.device.limits.apparent_mass_kg * options.nudge_mps;
  const double tap_m = 2 * impulse_Ns / (hand.stiffness_N_per_m * kTap_s);

  HandPlan plan(upright(-kStart_m));
  plan.hold(0.3).moveTo(upright(depth_m), kPressSpeed_mps, Motion::kMinJerk).hold(options.settle_s);
  plan.moveIn(upright(depth_m + tap_m), kTap_s / 2, Motion::kLinear)
      .moveIn(upright(depth_m), kTap_s / 2, Motion::kLinear);
  const TimeWindow watch{plan.duration_s(), plan.duration_s() + options.watch_s};
  plan.hold(options.watch_s);

  ASSIGN_OR_RETURN(auto run, runScene(source, scene, plan, plant));
  const NudgeOutcome outcome = outcomeOf(run, watch, plant.device.encoder_step_m);
  return NudgeRun{std::move(run), watch, outcome};
}

namespace {

void stiffen(SceneSpec& fem, double factor) {
  for (FemLayerSpec& layer : fem.fem.layers) layer.young_Pa *= factor;
  auto scaled = std::make_shared<NeedleCompliance>(*fem.fem.compliance);
  for (double& give : scaled->give_m_per_N) give /= factor;
  fem.fem.compliance = std::move(scaled);
}

}  // namespace

Result<ScannedModel> ScannedModel::prepare(const SceneSpec& scene, AxialModel model,
                                           const PlantOptions& plant, const NudgeOptions& options) {
  ScannedModel scanned(scene, likeForLike(scene, model));
  RETURN_IF_ERROR(addCompliance(scanned.scene_));
  ASSIGN_OR_RETURN(const auto compiled, compile(scanned.scene_, plant.rate_hz));
  scanned.damping_Ns_per_m_ = compiled.axial_damping_Ns_per_m;
  if (model != AxialModel::kFem) return scanned;

  // the felt stiffness depends on depth: iterate towards the wall's own stiffness in a few steps
  constexpr int kSteps = 4;
  const double wanted = scene.tracking_wall.stiffness_N_per_m;
  for (int step = 0; step < kSteps; ++step) {
    ASSIGN_OR_RETURN(const auto run, nudge(engineSource(), scanned.scene_, wanted, plant, options));
    scanned.felt_N_per_m_ = run.outcome.wall_N_per_m;
    if (!(scanned.felt_N_per_m_ > 0))
      return Error{ErrorCode::kFailed, "the mesh is felt to have no stiffness in this scene"};
    if (step + 1 < kSteps) stiffen(scanned.scene_, wanted / scanned.felt_N_per_m_);
  }
  return scanned;
}

SceneSpec ScannedModel::with(double stiffness_N_per_m) const {
  if (model() == AxialModel::kFem) {
    SceneSpec fem = scene_;
    stiffen(fem, stiffness_N_per_m / felt_N_per_m_);
    return fem;
  }
  SceneSpec wall = wall_;
  wall.tracking_wall.stiffness_N_per_m = stiffness_N_per_m;
  return likeForLike(wall, model());
}

}  // namespace needlelab
