/// Gestures as the station records them, for the studies of storage and live frames.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/study.h"
#include "common/gesture/sample.h"
#include "common/haptics/scene_model.h"

namespace needlelab {

/// A recorded gesture with the scene in which it was made, at 1 kHz.
struct StudyLesson {
  std::string name;
  SceneModel model;
  std::vector<GestureSample> samples;
};

/// A hand in closed loop in the paper's six layers, some 30 s, with exact encoders. The time that device and
/// engine took is made up (8-12 µs and 30-430 ns, from a seed), so that these columns are as restless as a
/// real loop's.
Result<StudyLesson> generatedLesson();

/// The recorded hand movements of a real Virtuose (`DATA/virtuose`), played through a ball of the paper's
/// tissue around the point farthest from the start. Empty when they are not there.
Result<std::vector<StudyLesson>> recordedLessons(const AccuracyOptions& options);

/// The poses of `samples` through gate and engine again; the force on the hand of each, in N.
std::vector<Vec3> recomputedForces(const SceneModel& model, const std::vector<GestureSample>& samples);

}  // namespace needlelab
