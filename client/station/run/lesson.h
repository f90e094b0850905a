/// A lesson's contents: profile, exercise and the scene made of them, fitted to the device.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/hand_options.h"
#include "client/station/run/live_line.h"
#include "client/station/run/options.h"
#include "common/base/result.h"
#include "common/haptics/scene_model.h"
#include "common/profile/aid_list.h"
#include "needlelab/control.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Everything of a lesson that the station needs, ready to run.
struct StationLesson {
  pb::Profile profile;
  std::uint32_t profile_revision = 0;  ///< 0: from a file
  std::optional<pb::Exercise> exercise;
  SceneSpec scene;  ///< in W
  SceneModel model;
  std::vector<std::string> warnings;           ///< of the profile, for a person
  std::uint32_t attempt = 0;                   ///< the trainee's attempt number; 0: not known
  std::optional<std::uint32_t> attempts_left;  ///< this one included; none: as many as one likes
};

/// From a profile in a file (`options.profile_file`). Errors: kInvalidInput.
Result<StationLesson> lessonOfFile(const StationOptions& options);
/// From the server's or the cache's answer. Errors: kInvalidInput, naming the exercise.
Result<StationLesson> lessonOfMessage(const StationOptions& options, const pb::Lesson& lesson);

/// The numbers that the exercise allows on the live line; all of them where it does not say.
LiveAids aidsOf(const StationLesson& lesson);
/// The same for aids that were chosen.
LiveAids aidsOf(const AidList& aids);

/// The profile's targets in W.
std::vector<PlanTarget> targetsOf(const pb::Profile& profile, const Pose& X_WL);

/// Names of the live effects, e.g. CUTTING.
std::vector<std::string> liveEffects(const SceneModel& model);

/// Refuses a scene that is stiffer than the device can render (FORCE_MODEL.md, "Device limits"), with the
/// numbers; a device that renders no force takes every scene. Errors: kInvalidInput.
Status checkStiffness(const SceneModel& model, const DeviceInfo& device);
/// Above (b + b_hand)/(T(½ + delay)) a stiffness can oscillate: a warning with the numbers, or nothing.
std::optional<std::string> passivityWarning(const SceneModel& model, const DeviceInfo& device,
                                            double hand_damping_Ns_per_m);

/// The scene as `device` can render it. The orientation limit is not live where no torque is rendered (a
/// device that renders nothing at all, such as a recording, keeps it: it is computed for the record) or no
/// orientation is measured. Adds to `notes` what was left out or assumed.
SceneSpec forDevice(SceneSpec scene, const DeviceInfo& device, std::vector<std::string>& notes);

/// Adds to `notes` how the tool is used on such a device.
void noteTool(const Pose& X_HT, const DeviceInfo& device, std::vector<std::string>& notes);

/// Makes `lesson`'s scene and model those for the device, with all notes. Errors: kInvalidInput.
Status fitLesson(StationLesson& lesson, const DeviceInfo& device, const StationOptions& options,
                 std::vector<std::string>& notes);

}  // namespace needlelab
