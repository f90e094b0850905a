#include "tests/class/class_gesture.h"

#include <cmath>
#include <utility>

#include "client/device/simulated_device.h"
#include "client/device/skilled_hand.h"
#include "client/sim/tools/closed_loop.h"
#include "common/fem/needle_mesh.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

constexpr double kLongest_s = 600;

}  // namespace

Result<ClassLesson> classLessonOf(const pb::Lesson& message) {
  ClassLesson lesson;
  auto exercise = parseExercise(message.exercise_json(), "the lesson's exercise");
  if (!exercise.ok()) return exercise.error();
  lesson.exercise = std::move(*exercise);
  const std::string source = "profile of exercise " + lesson.exercise.id();
  auto profile = parseProfile(message.profile_json(), source);
  if (!profile.ok()) return profile.error();
  if (profile->targets().empty())
    return Error{ErrorCode::kInvalidInput, source + " has no target: nothing to aim at"};
  auto scene = sceneSpecOf(*profile, Pose{});
  if (!scene.ok()) return scene.error();
  if (const Status status = addCompliance(*scene); !status.ok()) return status.error();
  auto model = compile(*scene, kClassRate_hz);
  if (!model.ok()) return model.error();
  const auto& center = profile->targets(0).center_m();
  lesson.target_m = {center.x(), center.y(), center.z()};
  lesson.profile = *std::move(profile);
  lesson.profile_revision = message.profile_revision();
  lesson.scene = *std::move(scene);
  lesson.model = *model;
  return lesson;
}

Result<std::vector<GestureSample>> practiseOnce(const ClassLesson& lesson, double skill, std::uint64_t seed) {
  HandRandom random(seed);
  const HandSkill hand = skillOf(skill);
  SimulatedDeviceOptions options;
  options.hand = handOf(hand, random.next());
  SimulatedDevice device(options, attemptPlan(hand, lesson.scene.limb, lesson.target_m, random,
                                              markedEntry(lesson.scene.limb, Pose{})));
  const double seconds = lesson.exercise.has_time_limit_s() ? lesson.exercise.time_limit_s() : kLongest_s;
  const auto ticks = runClosedLoop(lesson.model, device, {},
                                   static_cast<std::uint64_t>(std::llround(seconds * kClassRate_hz)));
  if (!ticks.ok()) return ticks.error();
  std::vector<GestureSample> samples;
  samples.reserve(ticks->size());
  for (const ChainTick& tick : *ticks)
    samples.push_back(sampleOf(
        tick, kClassClock_ns + std::llround(static_cast<double>(tick.tick) * 1e9 / kClassRate_hz), 0, 0));
  return samples;
}

}  // namespace needlelab
