#include "client/sim/accuracy/study.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <memory>
#include <thread>
#include <utility>

#include "client/device/hand/hand_plan.h"
#include "client/device/hand/simulated_device.h"
#include "client/effect_cost/tick_cost.h"
#include "client/sim/tools/closed_loop.h"
#include "client/station/run/loop/real_time.h"
#include "client/station/run/loop/servo_loop.h"
#include "common/base/histogram.h"
#include "common/base/time/clock.h"
#include "common/fem/needle_mesh.h"
#include "common/fem/needle_study.h"

namespace needlelab {

const std::vector<AccuracyStudy>& accuracyStudies() {
  static const std::vector<AccuracyStudy> studies = {
      {Comparator::kVerification, verificationRows},
      {Comparator::kRefinement, refinementRows},
      {Comparator::kReplay, replayRows},
  };
  return studies;
}

namespace {

constexpr double kDelayTicks = 1;  // of the simulated device
constexpr int kCountedNodes = 500;
constexpr std::size_t kRounds = 3;
constexpr std::uint64_t kMinTicks = 100;  // fewer have no 99th percentile; a busy machine misses most
constexpr double kDeepest_m = 0.03, kSpeed_mps = 0.03;

// In, rest, out, repeated for `seconds`.
HandPlan planOf(const SceneSpec& scene, double seconds) {
  const auto& limb = std::get<PlaneLimb>(scene.limb);
  const Vec3 outward = normalized(limb.normal);
  const Quat down = orientationAlong(outward * -1);
  const auto at = [&](double depth_m) { return Pose{limb.point_m - outward * depth_m, down}; };
  HandPlan plan(at(-0.002));
  plan.hold(0.05);
  while (plan.duration_s() < seconds)
    plan.moveTo(at(kDeepest_m), kSpeed_mps, Motion::kTrapezoid)
        .hold(0.2)
        .moveTo(at(-0.002), kSpeed_mps, Motion::kTrapezoid);
  return plan;
}

std::vector<TipSample> countedGesture(const SceneSpec& scene) {
  const HandPlan plan = planOf(scene, 2);
  std::vector<TipSample> tips;
  for (double t_s = 0; t_s < plan.duration_s(); t_s += 1 / kStationRate_hz)
    tips.push_back({plan.at(t_s).X_WT.p, plan.at(t_s).X_WT.q});
  return tips;
}

Result<LoopTimes> loopTimes(const SceneModel& model, const SceneSpec& scene, double seconds) {
  SimulatedDeviceOptions options;
  options.hand.seed = 1;
  SimulatedDevice device(options, planOf(scene, seconds));
  RETURN_IF_ERROR(device.open(kStationRate_hz));
  LoopTime clock;
  const auto ring = std::make_unique<SampleRing>();
  ServoSettings settings;
  settings.on_fault = FaultPolicy::kWait;
  settings.max_ticks = static_cast<std::uint64_t>(seconds * kStationRate_hz);
  const auto loop = std::make_unique<ServoLoop>(model, device, clock, *ring, settings);
  std::thread thread([&] { loop->run(); });
  thread.join();
  device.close();
  const LatencyQuantiles of = loop->stats().engine.quantiles();
  if (of.total < std::min(kMinTicks, settings.max_ticks))
    return Error{ErrorCode::kFailed, fmt::format("the loop stepped {} of {} ticks: the machine is too busy",
                                                 of.total, settings.max_ticks)};
  return LoopTimes{static_cast<double>(of.p50_ns), 0, 0, static_cast<double>(of.p999_ns)};
}

}  // namespace

Result<SceneSpec> studyScene() {
  return paperSceneSpec("paper-six-layers", {});
}

Result<std::vector<StudyModel>> studyModels(const SceneSpec& scene, int fem_nodes) {
  std::vector<StudyModel> models;
  for (std::size_t m = 0; m < kAxialModelCount; ++m) {
    const auto model = static_cast<AxialModel>(m);
    if (model == AxialModel::kFem) {
      ASSIGN_OR_RETURN(const auto fem, femLikeForLike(scene, fem_nodes));
      for (const int stations : kStationCounts) {
        models.push_back({model, fmt::format("{} stations", stations), fem.spec, stations});
        NeedleMeshOptions mesh;
        mesh.nodes = fem_nodes;
        mesh.stations = stations;
        ASSIGN_OR_RETURN(const auto compliance, precomputeCompliance(fem.spec, mesh));
        models.back().spec.fem.compliance = compliance;
      }
      continue;
    }
    models.push_back({model, {}, likeForLike(scene, model)});
    if (model != AxialModel::kVoigt) continue;
    models.push_back({model, "velocity over an adaptive window", models.back().spec});
    models.back().spec.voigt.velocity_noise_m = kStationEncoder_m;
  }
  return models;
}

double axialForce_N(const StepReport& report) {
  return report.cutting_N + report.attracted_N + report.friction_N + report.puncture_N;
}

Result<std::vector<ModelCost>> measureCosts(double seconds, const AccuracyProgress& progress) {
  ASSIGN_OR_RETURN(const auto scene, studyScene());
  ASSIGN_OR_RETURN(const auto studied, studyModels(scene, kCountedNodes));
  std::vector<ModelCost> costs;
  std::vector<SceneModel> models;
  for (const StudyModel& study : studied) {
    ASSIGN_OR_RETURN(const auto model, compile(study.spec, kStationRate_hz));
    models.push_back(model);
    costs.push_back({std::string(axialModelName(study.model)), study.variant, study.stations, {}, {}, 0});
    const double limit_N_per_m = DeviceLimits{}.damping_Ns_per_m * kStationRate_hz / (0.5 + kDelayTicks);
    costs.back().margin = limit_N_per_m / model.axial_stiffness_N_per_m;
  }
  // in turns, so that a slow minute of the machine affects all models
  std::vector<std::array<LoopTimes, kRounds>> times(models.size());
  for (std::size_t round = 0; round < kRounds; ++round)
    for (std::size_t m = 0; m < models.size(); ++m) {
      progress("the station's loop, " + costs[m].model,
               static_cast<double>(round * models.size() + m) / static_cast<double>(kRounds * models.size()));
      ASSIGN_OR_RETURN(times[m][round], loopTimes(models[m], studied[m].spec, seconds));
    }
  for (std::size_t m = 0; m < models.size(); ++m) {
    std::vector<double> p50_ns, p999_ns;
    for (const LoopTimes& round : times[m]) {
      p50_ns.push_back(round.p50_ns);
      p999_ns.push_back(round.p999_ns);
    }
    const auto [low, high] = std::minmax_element(p50_ns.begin(), p50_ns.end());
    costs[m].time = LoopTimes{medianOf(p50_ns), *low, *high, medianOf(p999_ns)};
  }
  printAsEqual(costs);
  return costs;
}

void printAsEqual(std::vector<ModelCost>& costs) {
  std::vector<LoopTimes*> times;
  for (ModelCost& cost : costs)
    if (cost.time) times.push_back(&*cost.time);
  std::sort(times.begin(), times.end(),
            [](const LoopTimes* a, const LoopTimes* b) { return a->low_ns < b->low_ns; });
  for (std::size_t from = 0, to = 0; from < times.size(); from = to) {
    std::vector<double> p50_ns;
    LoopTimes common = *times[from];
    double least_high_ns = common.high_ns;  // what begins below it overlaps each of the group
    for (; to < times.size() && times[to]->low_ns <= least_high_ns; ++to) {
      common.high_ns = std::max(common.high_ns, times[to]->high_ns);
      least_high_ns = std::min(least_high_ns, times[to]->high_ns);
      p50_ns.push_back(times[to]->p50_ns);
    }
    for (std::size_t i = from; i < to; ++i)
      *times[i] = {medianOf(p50_ns), common.low_ns, common.high_ns, times[i]->p999_ns};
  }
}

Status countInstructions(const std::vector<std::string>& command, std::vector<ModelCost>& costs) {
  ASSIGN_OR_RETURN(const auto scene, studyScene());
  const auto ticks = static_cast<double>(countedGesture(scene).size());
  ASSIGN_OR_RETURN(const auto counts, countStepInstructions(command, costs.size()));
  for (std::size_t i = 0; i < costs.size(); ++i)
    costs[i].instructions = static_cast<double>(counts[i]) / ticks;
  return {};
}

Status stepForCounting() {
  ASSIGN_OR_RETURN(const auto scene, studyScene());
  ASSIGN_OR_RETURN(const auto models, studyModels(scene, kCountedNodes));
  const std::vector<TipSample> tips = countedGesture(scene);
  for (const StudyModel& study : models) {
    ASSIGN_OR_RETURN(const auto model, compile(study.spec, kStationRate_hz));
    SimState state{};
    StepReport report;
    for (const TipSample& tip : tips) {
      step(model, tip, state, report);
      keep(report);
    }
    endCountedPart();
  }
  return {};
}

void addCosts(const std::vector<ModelCost>& costs, AccuracyRows& rows) {
  for (AccuracyRow& row : rows) {
    if (row.rate_hz && *row.rate_hz != kStationRate_hz) continue;
    // FEM by its stations, if given
    const auto fits = [&](const ModelCost& cost) {
      if (cost.model != row.model) return false;
      if (cost.stations > 0) return row.stations && *row.stations == cost.stations;
      return cost.variant == row.variant;
    };
    const auto at = std::find_if(costs.begin(), costs.end(), fits);
    if (at == costs.end()) continue;
    row.time = at->time;
    row.instructions = at->instructions;
    row.margin = at->margin;
  }
}

}  // namespace needlelab
