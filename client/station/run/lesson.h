/// A lesson's contents: profile, exercise, and their scene, adapted to the device.
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
#include "common/haptics/passivity_control.h"
#include "common/haptics/scene_model.h"
#include "common/profile/aid_list.h"
#include "needlelab/control.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Lessons count so many ticks where no delay was measured: one to read, compute and write, one in the
/// device.
inline constexpr double kAssumedDelayTicks = 2;

/// The delay that a lesson counts (measure_delay.h).
struct LoopDelay {
  double ticks = kAssumedDelayTicks;  ///< from a reading to its force …
  double lag_s = 0;                   ///< … behind a lag
  bool is_known = false;              ///< measured, or known by construction; else assumed
  /// What a limit of stiffness counts.
  [[nodiscard]] double totalTicks(double rate_hz) const { return ticks + lag_s * rate_hz; }
};

/// All data of a lesson that the station needs, ready to run.
struct StationLesson {
  pb::Profile profile;
  std::uint32_t profile_revision = 0;  ///< 0: from a file
  std::optional<pb::Exercise> exercise;
  SceneSpec scene;  ///< in W
  SceneModel model;
  std::vector<std::string> warnings;           ///< warnings about the profile, for a person
  double stiffness_share = 1;                  ///< as in SessionDescription
  std::optional<PassivitySettings> passivity;  ///< none: no passivity control
  bool bone_left_out = false;                  ///< the profile lists BONE, and device and tool do not hold it
  std::uint32_t attempt = 0;                   ///< the trainee's attempt number; 0: unknown
  std::optional<std::uint32_t> attempts_left;  ///< including this one; none: unlimited
  bool exam = false;                           ///< nobody changes its aids
  std::int64_t results_from_unix_ns = 0;       ///< of an exam: no result is shown before; 0: at once
};

/// Makes a lesson from a profile file (`options.profile_file`). Errors: kInvalidInput.
Result<StationLesson> lessonOfFile(const StationOptions& options);
/// Makes a lesson from the answer of the server or the cache. Errors: kInvalidInput, naming the exercise.
Result<StationLesson> lessonOfMessage(const StationOptions& options, const pb::Lesson& lesson);

/// Returns the aids that the trainee sees at the beginning: the exercise's, or the usual ones.
AidList allowedAids(const StationLesson& lesson);
/// Returns the figures that the exercise allows on the live line; all of them if it sets nothing.
LiveAids aidsOf(const StationLesson& lesson);
/// The same for chosen aids.
LiveAids aidsOf(const AidList& aids);

/// Returns where the tip has to be for an injection into each target of the profile, in W (tipForTarget).
std::vector<PlanTarget> targetsOf(const pb::Profile& profile, const Pose& X_WL);

/// Returns the names of the live effects, e.g. CUTTING.
std::vector<std::string> liveEffects(const SceneModel& model);

/// Refuses a scene that is stiffer along the needle than the device can render (FORCE_MODEL.md, "Device
/// limits"); across it, see lowerForDevice. A device that renders no force accepts every scene. Errors:
/// kInvalidInput, with the numbers.
Status checkStiffness(const SceneModel& model, const DeviceInfo& device);
/// Above (b + b_hand)/(T(½ + delay)) a stiffness can oscillate with this hand (coupled stability; passivity,
/// whatever the hand, would count the device's b alone): returns a warning with the numbers, or nothing.
std::optional<std::string> stabilityWarning(const SceneModel& model, const DeviceInfo& device,
                                            const LoopDelay& delay, double hand_damping_Ns_per_m);

/// Why passivity is not proven, with the numbers; nothing where it is: along and across the needle the scene
/// is at most b/(T(½ + delay)), which no hand can make unstable, and about the handle the device's limit in
/// the proportion of that delay to one tick's.
std::optional<std::string> unprovenPassivity(const StationLesson& lesson, const DeviceInfo& device,
                                             const LoopDelay& delay, const Pose& X_HT);

/// Returns the scene as `device` can render it. Turns the orientation limit off if the device renders no
/// torque or measures no orientation. A device that renders nothing at all, such as a recording, keeps the
/// limit: the engine computes it for the record. Adds omissions and assumptions to `notes`.
SceneSpec forDevice(SceneSpec scene, const DeviceInfo& device, std::vector<std::string>& notes);

/// Lowers fixture, bone and orientation limit of `lesson.scene` to what device and tool's lever hold
/// (FORCE_MODEL.md, "Device limits"), and says so in `notes`. Where less than kLeastStiffnessShare of it
/// would be left, BONE is left out first. A device that renders no force feels no stiffness; one without
/// torque does not render the lever. `lesson.model` is of the scene as it was, and stays. Errors:
/// kInvalidInput, with the numbers, where less than kLeastStiffnessShare is left without bone, too.
Status lowerForDevice(StationLesson& lesson, const DeviceInfo& device, const Pose& X_HT,
                      std::vector<std::string>& notes);

/// What a passivity control counts of a device.
PassivitySettings passivityOf(const DeviceInfo& device, const LoopDelay& delay);

/// Adds to `notes` how this device uses the tool.
void noteTool(const Pose& X_HT, const DeviceInfo& device, std::vector<std::string>& notes);

/// Adapts `lesson`'s scene and model to the device, with all notes. Turns passivity control on where
/// passivity is not proven, or --passivity-control asks for it. Errors: kInvalidInput.
Status fitLesson(StationLesson& lesson, const DeviceInfo& device, const LoopDelay& delay,
                 const StationOptions& options, std::vector<std::string>& notes);

}  // namespace needlelab
