#include "client/sim/stability/scan_nudge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "client/sim/stability/case.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/models/fem_needle.h"
#include "common/haptics/models/like_for_like.h"

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

// the needle's drift: the mean over the time around a tick
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
  Swing middle, end;
  std::vector<double> end_N;
  Slope wall;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const PlantTick& tick = run.ticks[i];
    const double share = (tick.time_s - watch.from_s) / (watch.to_s - watch.from_s);
    if (share < 0) continue;
    const double swing = tick.p_W_m.z - slow.at(i), resistance_N = tick.report.wrench_W.force_N.z;
    wall.add(-tick.seen.p_WT_m.z, resistance_N);
    if (share >= 0.3 && share < 0.5) middle.add(swing);
    if (share >= 0.75 && share < 0.95) end.add(swing), end_N.push_back(resistance_N);
  }
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
  // where hand and wall balance at `press_N`
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

  ASSIGN_OR_RETURN(auto run, runScene(source, scene, plan, plant));
  const NudgeOutcome outcome = outcomeOf(run, watch, plant.device.encoder_step_m);
  return NudgeRun{std::move(run), watch, outcome};
}

namespace {

using Complex = std::complex<double>;

// mass, damper and spring behind a zero-order hold: Σ of the residues of the step response, times 1 − z⁻¹
class PulseTransfer {
 public:
  explicit PulseTransfer(const LinearLoop& loop) {
    const double half = loop.damping_Ns_per_m / (2 * loop.mass_kg);
    const Complex root = std::sqrt(Complex(half * half - loop.stiffness_N_per_m / loop.mass_kg));
    const Complex p1 = -half + root, p2 = -half - root;
    gain_ = 1 / loop.stiffness_N_per_m;
    a1_ = 1.0 / (loop.mass_kg * p1 * (p1 - p2));
    a2_ = 1.0 / (loop.mass_kg * p2 * (p2 - p1));
    e1_ = std::exp(p1 * loop.period_s);
    e2_ = std::exp(p2 * loop.period_s);
  }
  [[nodiscard]] Complex at(Complex z) const {
    return gain_ + (z - 1.0) * (a1_ / (z - e1_) + a2_ / (z - e2_));
  }

 private:
  double gain_;
  Complex a1_, a2_, e1_, e2_;
};

// the K that closes the loop 1 + (K + B (1 − z⁻¹)/T) G z⁻ᵈ = 0 at z = e^{jφ}; a wall can have it where it is
// real
Complex closingStiffness(const LinearLoop& loop, const PulseTransfer& plant, double phase_rad) {
  const Complex z = std::polar(1.0, phase_rad);
  const Complex late = std::polar(1.0, phase_rad * static_cast<double>(loop.delay_ticks));
  return -late / plant.at(z) - loop.wall_damping_Ns_per_m / loop.period_s * (1.0 - 1.0 / z);
}

}  // namespace

double passiveStiffnessLimit(double damping_Ns_per_m, double period_s, double delay_ticks) {
  return damping_Ns_per_m / (period_s * (0.5 + delay_ticks));
}

double quantisedStiffnessLimit(double damping_Ns_per_m, double period_s, double dry_friction_N,
                               double encoder_step_m) {
  const double by_time = 2 * damping_Ns_per_m / period_s;
  return encoder_step_m > 0 ? std::min(by_time, 2 * dry_friction_N / encoder_step_m) : by_time;
}

double sampledStiffnessLimit(const LinearLoop& loop) {
  const PulseTransfer plant(loop);
  constexpr int kSteps = 20'000;  // of the upper half of the unit circle
  constexpr double kHalfTurn = 3.14159265358979323846;
  double best = std::numeric_limits<double>::infinity();
  double before = kHalfTurn / kSteps;
  for (int i = 2; i <= kSteps; ++i) {
    const double here = kHalfTurn * i / kSteps;
    double from = before, to = here;
    before = here;
    const bool rising = closingStiffness(loop, plant, from).imag() < 0;
    if (rising == (closingStiffness(loop, plant, to).imag() < 0)) continue;
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = (from + to) / 2;
      ((closingStiffness(loop, plant, middle).imag() < 0) == rising ? from : to) = middle;
    }
    const double stiffness = closingStiffness(loop, plant, to).real();
    if (stiffness > 0) best = std::min(best, stiffness);
  }
  return best;
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
  if (model != AxialModel::kFem) return scanned;

  RETURN_IF_ERROR(addCompliance(scanned.scene_));
  // the felt stiffness depends on depth: iterate to the wall's own stiffness in a few steps
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

double ScannedModel::damping_Ns_per_m() const {
  return model() == AxialModel::kVoigt ? scene_.voigt.damping_Ns_per_m : 0;
}

std::string_view stiffnessParameter(AxialModel model) {
  constexpr std::array<std::string_view, kAxialModelCount> kParameters = {
      "tracking_wall.stiffness_n_per_m",
      "tracking_wall.stiffness_n_per_m",
      "direct.stiffness_n_per_m",
      "voigt.stiffness_n_per_m, damping_ns_per_m at 5",
      "god_object.stiffness_n_per_m",
      "first_order.stiffness_n_per_m of the layer, up to puncture",
      "tracking_wall.stiffness_n_per_m, which renders the table",
      "tracking_wall.stiffness_n_per_m, which renders the table",
      "fem: Young's modulus of all layers, as the stiffness that is felt at this depth",
      "okamura.linear_n_per_m of the layer, up to puncture",
      "okamura.linear_n_per_m of the layer, up to puncture"};
  return kParameters[static_cast<std::size_t>(model)];
}

}  // namespace needlelab
