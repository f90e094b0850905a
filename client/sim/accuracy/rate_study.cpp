#include "client/sim/accuracy/study.h"

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "client/device/simulated_device.h"
#include "client/sim/accuracy/gesture.h"
#include "client/sim/accuracy/row.h"
#include "client/sim/tools/closed_loop.h"
#include "common/base/clock.h"

namespace needlelab {
namespace {

constexpr std::array<double, 7> kRates_hz = {250, 500, 1000, 2000, 4000, 5000, 10'000};
constexpr double kReference_hz = 20'000;
constexpr std::uint32_t kDelayTicks = 1;

SimulatedDeviceOptions deviceOf(std::uint64_t seed) {
  SimulatedDeviceOptions options;
  options.hand.seed = seed;
  options.delay_ticks = kDelayTicks;
  // the same integration step for every rate, so that the hand is the same: every rate divides it
  options.integration_hz = 2 * kReference_hz;
  return options;
}

Result<std::vector<ChainTick>> run(const StudyScene& scene, std::uint64_t seed, double rate_hz) {
  ASSIGN_OR_RETURN(const auto model, compile(scene.spec, rate_hz));
  SimulatedDevice device(deviceOf(seed), studyPlan(scene.spec, seed));
  const double duration_s = studyPlan(scene.spec, seed).duration_s();
  return runClosedLoop(model, device, {}, static_cast<std::uint64_t>(duration_s * rate_hz));
}

// the force that acts on the hand at step `i` of the reference's clock: sampled, late, held
Vec3 acting_N(const std::vector<ChainTick>& ticks, double rate_hz, std::size_t i) {
  const auto per_tick = static_cast<std::size_t>(std::lround(kReference_hz / rate_hz));
  const std::size_t tick = i / per_tick;
  if (tick < kDelayTicks || tick - kDelayTicks >= ticks.size()) return {};
  return ticks[tick - kDelayTicks].rendered_W.force_N;
}

ErrorSum errorOf(const std::vector<ChainTick>& ticks, double rate_hz,
                 const std::vector<ChainTick>& reference) {
  ErrorSum sum;
  for (std::size_t i = 0; i < reference.size(); ++i)
    sum.add(norm(acting_N(ticks, rate_hz, i) - acting_N(reference, kReference_hz, i)));
  return sum;
}

double greatestStep_N(const std::vector<ChainTick>& ticks) {
  double step_N = 0;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    const Vec3 before = ticks[i - 1].rendered_W.force_N, now = ticks[i].rendered_W.force_N;
    if (!isRelease(ticks[i].report.flags, norm(before), norm(now)))
      step_N = std::max(step_N, norm(now - before));
  }
  return step_N;
}

double meanForce_N(const std::vector<ChainTick>& ticks) {
  ErrorSum inside;
  for (const ChainTick& tick : ticks)
    if (tick.report.phase != Phase::kFree) inside.add(norm(tick.rendered_W.force_N));
  return inside.rms();
}

// gate and engine over the poses that the device reported in a run, without the device
Result<TimedTick> timed(const StudyScene& scene, double rate_hz, const std::vector<ChainTick>& ticks) {
  struct Run {
    explicit Run(SceneModel compiled) : model(std::move(compiled)) {}
    SceneModel model;
    std::optional<HapticChain> chain;
    ChainTick out;
    DeviceReading reading;
    std::size_t next = 0;
  };
  ASSIGN_OR_RETURN(auto model, compile(scene.spec, rate_hz));
  const auto run = std::make_shared<Run>(std::move(model));
  return TimedTick{[run, &ticks] {
                     if (run->next == 0) run->chain.emplace(run->model, DeviceLimits{}, Pose{});
                     run->reading.X_WH = ticks[run->next].X_WH;
                     keep(run->chain->tick(run->reading, true, 1, 1.0, run->out));
                     if (++run->next == ticks.size()) run->next = 0;
                   },
                   ticks.size()};
}

struct Sweep {
  const AccuracyOptions& options;
  const AccuracyProgress& progress;
  std::vector<StudyScene> scenes;  // each of them with each model
  std::size_t done = 0;
};

Status sweepScene(Sweep& sweep, const StudyScene& scene, const std::string& model, AccuracyRows& rows) {
  const std::uint64_t seeds = sweep.options.long_form ? 12 : 3;
  std::array<ErrorRuns, kRates_hz.size()> errors;
  std::array<double, kRates_hz.size()> steps_N{};
  std::array<std::vector<ChainTick>, kRates_hz.size()> kept;  // of the first seed, for the timing
  ASSIGN_OR_RETURN(const auto at_1khz, compile(scene.spec, 1000));
  const double stiffness_N_per_m = at_1khz.axialStiffness_N_per_m();
  double force_N = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    ASSIGN_OR_RETURN(const auto reference, run(scene, seed, kReference_hz));
    force_N = std::max(force_N, meanForce_N(reference));
    for (std::size_t r = 0; r < kRates_hz.size(); ++r) {
      ASSIGN_OR_RETURN(auto ticks, run(scene, seed, kRates_hz[r]));
      errors[r].add(errorOf(ticks, kRates_hz[r], reference));
      steps_N[r] = std::max(steps_N[r], greatestStep_N(ticks));
      if (seed == 1) kept[r] = std::move(ticks);
    }
  }
  std::vector<TimedTick> ticks;
  for (std::size_t r = 0; r < kRates_hz.size(); ++r) {
    ASSIGN_OR_RETURN(auto one, timed(scene, kRates_hz[r], kept[r]));
    ticks.push_back(std::move(one));
  }
  const std::vector<TickCost> costs = measureTicks(ticks, costEffort(sweep.options));
  for (std::size_t r = 0; r < kRates_hz.size(); ++r) {
    AccuracyRow row;
    row.study = AccuracyStudy::kRate;
    row.scene = scene.name;
    row.model = model;
    row.rate_hz = kRates_hz[r];
    row.reference = "the same hand and scene in a loop of 20 kHz";
    row.rms_error_n = errors[r].rms();
    row.max_error_n = errors[r].max();
    row.rms_error_spread_n = errors[r].spread();
    row.max_step_n = steps_N[r];
    // FORCE_MODEL.md, "Device limits", for a hand without damping
    const double limit_N_per_m = DeviceLimits{}.damping_Ns_per_m * kRates_hz[r] / (0.5 + kDelayTicks);
    row.stiffness_margin = limit_N_per_m / stiffness_N_per_m;
    row.noticeable_n = noticeableForce_N(force_N);
    setCost(row, costs[r], kRates_hz[r]);
    row.uncertainty = spreadText(errors[r], "hands") + "; " + costText(costs[r]);
    row.cannot_show =
        "the cost of waking up and of the device's exchange (about 50 us a tick on a real loop), and a hand "
        "that answers to what it feels";
    rows.push_back(std::move(row));
  }
  return {};
}

}  // namespace

Result<AccuracyRows> rateStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& /*notes*/) {
  ASSIGN_OR_RETURN(auto scenes, studyScenes());
  Sweep sweep{options, progress, std::move(scenes)};
  AccuracyRows rows;
  for (const StudyScene& scene : sweep.scenes) {
    progress("rate: " + scene.name,
             static_cast<double>(sweep.done++) / static_cast<double>(sweep.scenes.size()));
    RETURN_IF_ERROR(sweepScene(sweep, scene, "ENHANCED_TRACKING_WALL", rows));
  }
  return rows;
}

}  // namespace needlelab
