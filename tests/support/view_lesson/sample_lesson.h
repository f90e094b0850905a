/// A sample lesson for display: the needle goes to the first target of a profile with a little tremor, rests,
/// and comes out again. For tests and benchmarks of the display; it needs no device and no clock.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/view/model/scene_view.h"
#include "common/gesture/sample.h"
#include "common/haptics/engine.h"
#include "needlelab/profile.pb.h"

namespace needlelab::test {

struct SampleLesson {
  pb::Profile profile;
  std::shared_ptr<const SceneModel> model;
  std::shared_ptr<const SceneView> scene;
  std::vector<GestureSample> samples;  ///< 1 kHz, as the engine saw them
  std::vector<StepReport> reports;     ///< the engine's own, one per sample
};

struct LessonShape {
  double lateral_m = 0.0015;  ///< how far beside the target the hand aims
  double tilt_rad = 0.12;     ///< between the needle and the surface normal
  double approach_s = 0.6, insert_s = 2.5, rest_s = 1.0, withdraw_s = 1.5;
  double beyond_m = 0;  ///< past the target's centre
};

/// `name`: a file of db/samples without its extension, e.g. "shoulder-adult". Throws nothing; a missing
/// profile is a test error and ends the program with a message.
SampleLesson sampleLesson(const std::string& name, const LessonShape& shape = {});

}  // namespace needlelab::test
