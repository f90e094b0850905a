#include "client/sim/accuracy/gesture.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "client/device/hand.h"
#include "client/device/recording_device.h"
#include "client/device/simulated_device.h"
#include "client/sim/tools/closed_loop.h"
#include "common/base/clock.h"

namespace needlelab {
namespace {

constexpr double kTremor_m = 50e-6;  // normal tremor, peak

double between(HandRandom& random, double low, double high) {
  return low + (high - low) * random.uniform();
}

double tissueThickness_m(const SceneSpec& spec) {
  double sum = 0;
  for (const LayerSpec& layer : spec.layers) sum += layer.thickness_m;
  return sum;
}

constexpr double kOutside_m = 0.008;  // where gestures begin and end, above the surface

// the straight way in along the normal
struct Path {
  Vec3 surface_W_m, outward;
  Quat down;
  double deepest_m;
  explicit Path(const SceneSpec& spec)
      : surface_W_m(std::get<PlaneLimb>(spec.limb).point_m),
        outward(normalized(std::get<PlaneLimb>(spec.limb).normal)),
        down(orientationAlong(outward * -1)),
        deepest_m(0.9 * std::min(tissueThickness_m(spec), spec.needle_length_m)) {}
  [[nodiscard]] Pose at(double depth_m) const { return {surface_W_m - outward * depth_m, down}; }
};

// the plan sampled, with tremor
StudyGesture gestureOf(const SceneSpec& spec, const HandPlan& plan, std::uint64_t seed, double rate_hz) {
  const Vec3 inward = normalized(std::get<PlaneLimb>(spec.limb).normal) * -1;
  HandTremor tremor(kTremor_m, seed, 1 / rate_hz);
  StudyGesture gesture;
  gesture.rate_hz = rate_hz;
  const auto ticks = static_cast<std::size_t>(plan.duration_s() * rate_hz);
  for (std::size_t i = 0; i < ticks; ++i) {
    const double t_s = static_cast<double>(i) / rate_hz;
    const Pose aim = plan.at(t_s).X_WT;
    const double v_mps = dot(inward, aim.p - plan.at(t_s - 1e-3).X_WT.p) / 1e-3;
    const double stop_mps = spec.tracking_wall.stop_speed_mps;
    gesture.intents.push_back(v_mps >= stop_mps    ? Intent::kIn
                              : v_mps <= -stop_mps ? Intent::kOut
                                                   : Intent::kRest);
    gesture.tips.push_back({aim.p + tremor.next(), aim.q});
  }
  return gesture;
}

}  // namespace

Result<std::vector<StudyScene>> studyScenes() {
  std::vector<StudyScene> scenes;
  for (const char* name : {"paper-1dof", "paper-six-layers"}) {
    ASSIGN_OR_RETURN(auto spec, paperSceneSpec(name, {}));
    scenes.push_back({name, std::move(spec)});
  }
  return scenes;
}

HandPlan studyPlan(const SceneSpec& spec, std::uint64_t seed) {
  const Path path(spec);
  HandRandom random(seed);
  const auto speed = [&] { return between(random, 0.008, 0.03); };
  const auto rest = [&] { return between(random, 0.4, 1.6); };
  const double first_m = path.deepest_m * between(random, 0.35, 0.7);
  const double second_m = path.deepest_m * between(random, 0.25, 1.0);
  HandPlan plan(path.at(-kOutside_m));
  plan.hold(0.3).moveTo(path.at(first_m), speed(), Motion::kTrapezoid).hold(rest());
  plan.moveTo(path.at(second_m), speed(), Motion::kMinJerk).hold(rest());
  plan.moveTo(path.at(-kOutside_m), speed(), Motion::kTrapezoid).hold(0.2);
  return plan;
}

StudyGesture studyGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz) {
  return gestureOf(spec, studyPlan(spec, seed), seed, rate_hz);
}

StudyGesture strokeGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz) {
  const Path path(spec);
  HandRandom random(seed);
  double depth_m = path.deepest_m * between(random, 0.3, 0.9);
  HandPlan plan(path.at(-kOutside_m));
  plan.hold(0.1).moveTo(path.at(depth_m), between(random, 0.01, 0.03), Motion::kTrapezoid);
  for (int stroke = 0; stroke < 12; ++stroke) {
    const double way_m = between(random, 0.5e-3, 3e-3);
    plan.moveTo(path.at(depth_m - way_m), between(random, 0.005, 0.02), Motion::kMinJerk);
    plan.moveTo(path.at(depth_m), between(random, 0.005, 0.02), Motion::kMinJerk);
  }
  plan.moveTo(path.at(-kOutside_m), between(random, 0.01, 0.03), Motion::kTrapezoid).hold(0.1);
  return gestureOf(spec, plan, seed, rate_hz);
}

ForceProfile::ForceProfile(const SceneSpec& spec, double rate_hz) : spec_(spec), period_s_(1 / rate_hz) {}

const LayerSpec& ForceProfile::layerAt(double depth_m) const {
  double top_m = 0;
  for (const LayerSpec& layer : spec_.layers) {
    top_m += layer.thickness_m;
    if (depth_m < top_m) return layer;
  }
  return spec_.layers.back();
}

double ForceProfile::atRest(double depth_m) const {
  const TrackingWallSpec& wall = spec_.tracking_wall;
  const double from_N = std::abs(moving_N_), to_N = std::min(from_N, layerAt(depth_m).rejection_force_N);
  const double t_s = rest_s_ - wall.stop_dwell_s;
  double force_N = from_N;
  if (t_s > 0 && wall.stop_mode == StopMode::kRamp)
    force_N = std::max(to_N, from_N - (from_N - to_N) * t_s / wall.stop_duration_s);
  if (t_s > 0 && wall.stop_mode == StopMode::kExponential) {
    const double left_N = std::max(to_N, wall.relax_residual * from_N);
    force_N = left_N + (from_N - left_N) * std::exp(-t_s / wall.relax_time_s);
  }
  return std::copysign(force_N, moving_N_);
}

double ForceProfile::next(double depth_m, Intent intent) {
  if (depth_m <= 0) {
    moving_N_ = rest_s_ = 0;
    return 0;
  }
  if (intent == Intent::kRest) {
    rest_s_ += period_s_;
    return atRest(depth_m);
  }
  rest_s_ = 0;
  const LayerSpec& layer = layerAt(depth_m);
  const auto live = [&](Effect effect) { return (spec_.effects & bitOf(effect)) != 0; };
  if (intent == Intent::kIn)
    moving_N_ = live(Effect::kCutting) ? -layer.cutting_force_N : 0;
  else
    moving_N_ = live(Effect::kAttracted) ? layer.attracted_force_N : 0;
  return moving_N_;
}

namespace {

double axialOf(const StepReport& report) {
  return report.cutting_N + report.attracted_N + report.friction_N + report.puncture_N;
}

}  // namespace

std::vector<double> axialForces(const SceneModel& model, const StudyGesture& gesture) {
  SimState state{};
  StepReport report;
  std::vector<double> forces_N;
  forces_N.reserve(gesture.tips.size());
  for (const TipSample& tip : gesture.tips) {
    step(model, tip, state, report);
    forces_N.push_back(axialOf(report));
  }
  return forces_N;
}

bool isRelease(std::uint32_t flags, double before_N, double after_N) {
  return (flags & (kFlagLayerChange | kFlagRupture | kFlagExit)) != 0 &&
         std::abs(after_N) < std::abs(before_N) && before_N * after_N >= 0;
}

double greatestStep_N(const SceneModel& model, const StudyGesture& gesture) {
  SimState state{};
  StepReport report;
  double step_N = 0, before_N = 0;
  for (const TipSample& tip : gesture.tips) {
    step(model, tip, state, report);
    const double now_N = axialOf(report);
    if (!isRelease(report.flags, before_N, now_N)) step_N = std::max(step_N, std::abs(now_N - before_N));
    before_N = now_N;
  }
  return step_N;
}

ErrorSum errorInTissue(const SceneModel& model, const StudyGesture& gesture,
                       const std::vector<double>& forces_N, const std::vector<double>& reference_N) {
  ErrorSum sum;
  for (std::size_t i = 0; i < forces_N.size(); ++i)
    if (signedDepth(model.limb, gesture.tips[i].p_WT_m) > 0) sum.add(forces_N[i] - reference_N[i]);
  return sum;
}

TimedTick timedSteps(const SceneModel& model, const StudyGesture& gesture) {
  struct Run {
    SimState state{};
    StepReport report;
    std::size_t next = 0;
  };
  // gestures begin and end outside: the state needs no reset
  return {[&model, &gesture, run = std::make_shared<Run>()] {
            step(model, gesture.tips[run->next], run->state, run->report);
            keep(run->report);
            if (++run->next == gesture.tips.size()) run->next = 0;
          },
          gesture.tips.size()};
}

double feltStiffness_N_per_m(const SceneModel& model, const SceneSpec& spec) {
  constexpr double kSpeed_mps = 0.01, kBack_m = 2e-4, kRest_s = 0.02;
  const Path path(spec);
  const double depth_m = 0.5 * path.deepest_m;
  HandPlan plan(path.at(-1e-3));
  plan.moveTo(path.at(depth_m), kSpeed_mps, Motion::kLinear).hold(kRest_s);
  const double pressed_s = plan.duration_s();
  plan.moveTo(path.at(depth_m - kBack_m), kSpeed_mps, Motion::kLinear).hold(kRest_s);
  StudyGesture gesture;
  gesture.rate_hz = model.rate_hz;
  const auto ticks = static_cast<std::size_t>(plan.duration_s() * model.rate_hz);
  for (std::size_t i = 0; i < ticks; ++i) {
    const Pose aim = plan.at(static_cast<double>(i) / model.rate_hz).X_WT;
    gesture.tips.push_back({aim.p, aim.q});
  }
  const std::vector<double> forces_N = axialForces(model, gesture);
  const auto pressed = static_cast<std::size_t>(pressed_s * model.rate_hz) - 1;
  return (forces_N.back() - forces_N[pressed]) / kBack_m;
}

std::string stiffnessRemark(double felt_N_per_m, double asked_N_per_m, std::string_view comparator) {
  if (std::abs(felt_N_per_m - asked_N_per_m) <= 0.1 * asked_N_per_m) return {};
  return fmt::format(
      ". Drawn back in the tissue it feels {:.3g} N/m, {} {:.3g}: some of the difference is that of "
      "stiffness",
      felt_N_per_m, comparator, asked_N_per_m);
}

void addCosts(const std::vector<TimedTick>& ticks, const AccuracyOptions& options, double rate_hz,
              AccuracyRows& rows) {
  const std::vector<TickCost> costs = measureTicks(ticks, costEffort(options));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    setCost(rows[i], costs[i], rate_hz);
    rows[i].uncertainty += "; " + costText(costs[i]);
  }
}

namespace {

constexpr double kLessonRate_hz = 1000;

std::vector<GestureSample> samplesOf(const std::vector<ChainTick>& ticks) {
  HandRandom random(1);
  std::vector<GestureSample> samples;
  samples.reserve(ticks.size());
  for (const ChainTick& tick : ticks) {
    const auto due_ns = static_cast<std::int64_t>(tick.tick) * 1'000'000;
    const auto device_ns = static_cast<std::int64_t>(8'000 + random.next() % 4'000);
    samples.push_back(sampleOf(tick, due_ns, device_ns, static_cast<std::int64_t>(30 + random.next() % 400)));
  }
  return samples;
}

DeviceReading readingOf(const GestureSample& s) {
  DeviceReading reading;
  reading.X_WH.p = {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]};
  reading.X_WH.q = {s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]};
  return reading;
}

}  // namespace

Result<StudyLesson> generatedLesson() {
  ASSIGN_OR_RETURN(const auto spec, paperSceneSpec("paper-six-layers", {}));
  ASSIGN_OR_RETURN(auto model, compile(spec, kLessonRate_hz));
  StudyLesson lesson{"generated lesson", std::move(model), {}};
  std::vector<ChainTick> all;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SimulatedDeviceOptions options;
    options.hand.seed = seed;
    options.encoder_step_m = options.encoder_step_rad =
        0;  // otherwise the encoder step hides the stored step
    SimulatedDevice device(options, studyPlan(spec, seed));
    const auto ticks = static_cast<std::uint64_t>(studyPlan(spec, seed).duration_s() * kLessonRate_hz);
    ASSIGN_OR_RETURN(auto run, runClosedLoop(lesson.model, device, {}, ticks));
    for (ChainTick& tick : run) {
      tick.tick = all.size();
      all.push_back(tick);
    }
  }
  lesson.samples = samplesOf(all);
  return lesson;
}

Result<std::vector<StudyLesson>> recordedLessons(const AccuracyOptions& options) {
  std::vector<StudyLesson> lessons;
  if (options.data.empty()) return lessons;
  for (const char* name : {"backward", "downward", "lateral_left", "virtuose_x_backward"}) {
    const auto file = options.data / "virtuose" / (std::string(name) + ".csv");
    if (!std::filesystem::exists(file)) continue;
    ASSIGN_OR_RETURN(const auto track, readPoseTrack(file));
    const std::vector<Pose> poses = resamplePoses(track, kLessonRate_hz);
    ASSIGN_OR_RETURN(auto spec, paperSceneSpec("paper-six-layers", {}));
    Vec3 far = poses.front().p;
    for (const Pose& pose : poses)
      if (norm(pose.p - poses.front().p) > norm(far - poses.front().p)) far = pose.p;
    spec.limb = SphereLimb{far, 0.6 * norm(far - poses.front().p)};
    ASSIGN_OR_RETURN(auto model, compile(spec, kLessonRate_hz));
    StudyLesson lesson{std::string("recorded hand ") + name, std::move(model), {}};

    HapticChain chain(lesson.model, DeviceLimits{}, {});
    std::vector<ChainTick> ticks(poses.size());
    DeviceReading reading;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      reading.X_WH = poses[i];
      chain.tick(reading, true, 1, 1.0, ticks[i]);
    }
    lesson.samples = samplesOf(ticks);
    lessons.push_back(std::move(lesson));
  }
  return lessons;
}

std::vector<Vec3> recomputedForces(const SceneModel& model, const std::vector<GestureSample>& samples) {
  HapticChain chain(model, DeviceLimits{}, {});
  std::vector<Vec3> forces_N;
  forces_N.reserve(samples.size());
  ChainTick tick;
  for (const GestureSample& sample : samples) {
    chain.tick(readingOf(sample), true, 1, 1.0, tick);
    forces_N.push_back(tick.rendered_W.force_N);
  }
  return forces_N;
}

}  // namespace needlelab
