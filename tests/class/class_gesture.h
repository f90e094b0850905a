/// One attempt by a simulated hand on virtual time: as a station would have recorded it, in a fraction of the
/// time that it takes.
#pragma once

#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/control.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

inline constexpr double kClassRate_hz = 1000;
/// The station's clock at the first tick of each session.
inline constexpr std::int64_t kClassClock_ns = 1'000'000'000;

/// What a lesson says, ready to be practised.
struct ClassLesson {
  pb::Profile profile;
  std::uint32_t profile_revision = 0;
  pb::Exercise exercise;
  SceneSpec scene;
  SceneModel model;
  Vec3 target_m;
};

/// Errors: kInvalidInput: a profile or exercise that cannot be read, or without a target.
Result<ClassLesson> classLessonOf(const pb::Lesson& message);

/// In closed loop with the engine and a simulated device; until the plan is done or the exercise's time is
/// up. Errors: kFailed, when the gate took the force away.
Result<std::vector<GestureSample>> practiseOnce(const ClassLesson& lesson, double skill, std::uint64_t seed);

}  // namespace needlelab
