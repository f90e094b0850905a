#include "client/sim/accuracy/lesson_samples.h"

#include <cmath>
#include <utility>

#include "client/device/hand_tremor.h"
#include "client/device/recording_device.h"
#include "client/device/simulated_device.h"
#include "client/sim/accuracy/gesture.h"
#include "client/sim/tools/closed_loop.h"
#include "client/sim/tools/figures.h"

namespace needlelab {
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
  const auto spec = paperSceneSpec("paper-six-layers", {});
  if (!spec.ok()) return spec.error();
  auto model = compile(*spec, kLessonRate_hz);
  if (!model.ok()) return model.error();
  StudyLesson lesson{"generated lesson", *std::move(model), {}};
  std::vector<ChainTick> all;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SimulatedDeviceOptions options;
    options.hand.seed = seed;
    options.encoder_step_m = options.encoder_step_rad = 0;  // else a step of its own hides the stored one
    SimulatedDevice device(options, studyPlan(*spec, seed));
    const auto ticks = static_cast<std::uint64_t>(studyPlan(*spec, seed).duration_s() * kLessonRate_hz);
    auto run = runClosedLoop(lesson.model, device, {}, ticks);
    if (!run.ok()) return run.error();
    for (ChainTick& tick : *run) {
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
    const auto track = readPoseTrack(file);
    if (!track.ok()) return track.error();
    const std::vector<Pose> poses = resamplePoses(*track, kLessonRate_hz);
    auto spec = paperSceneSpec("paper-six-layers", {});
    if (!spec.ok()) return spec.error();
    Vec3 far = poses.front().p;
    for (const Pose& pose : poses)
      if (norm(pose.p - poses.front().p) > norm(far - poses.front().p)) far = pose.p;
    spec->limb = SphereLimb{far, 0.6 * norm(far - poses.front().p)};
    auto model = compile(*spec, kLessonRate_hz);
    if (!model.ok()) return model.error();
    StudyLesson lesson{std::string("recorded hand ") + name, *std::move(model), {}};

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
