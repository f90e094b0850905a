/// A lesson's contents: profile, exercise, and their scene, adapted to the device.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/hand/hand_options.h"
#include "client/station/run/io/live_line.h"
#include "client/station/run/io/options.h"
#include "common/base/result.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/haptics/gate/passivity_control.h"
#include "common/haptics/scene_model.h"
#include "common/profile/aid_list.h"
#include "needlelab/control.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The delay that a lesson uses (measure_delay.h).
struct LoopDelay {
  double ticks = 0;       ///< from a reading to its force …
  double lag_s = 0;       ///< … plus this lag
  bool is_known = false;  ///< measured, or known by construction; otherwise assumed, by the table of devices
  /// The whole delay, for stiffness limits.
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
  StiffnessShares shares;                      ///< as in SessionDescription
  std::optional<PassivitySettings> passivity;  ///< none: no passivity control
  EffectMask left_out = 0;                     ///< effects of the profile that device and tool cannot hold
  std::uint32_t attempt = 0;                   ///< the trainee's attempt number; 0: unknown
  std::optional<std::uint32_t> attempts_left;  ///< including this one; none: unlimited
  bool exam = false;                           ///< its aids cannot be changed
  std::int64_t results_from_unix_ns = 0;       ///< exam: no result is shown before this time; 0: at once
};

/// Makes a lesson from a profile file (`options.profile_file`). Errors: kInvalidInput.
Result<StationLesson> lessonOfFile(const StationOptions& options);
/// Makes a lesson from the answer of the server or the cache. Errors: kInvalidInput, naming the exercise.
Result<StationLesson> lessonOfMessage(const StationOptions& options, const pb::Lesson& lesson);

/// Returns the aids that the trainee sees at the beginning: the exercise's, or the defaults.
AidList allowedAids(const StationLesson& lesson);
/// Returns the figures that the exercise allows on the live line; all of them if it sets nothing.
LiveAids aidsOf(const StationLesson& lesson);
/// Likewise for chosen aids.
LiveAids aidsOf(const AidList& aids);

/// Returns the tip's position for an injection into each target of the profile, in W (tipForTarget).
std::vector<PlanTarget> targetsOf(const pb::Profile& profile, const Pose& X_WL);

/// What a trainee must know before an exam begins: "1 attempt left, 5 min, counts".
std::string examTerms(const StationLesson& lesson, double time_limit_s);

/// Returns the names of the live effects, e.g. CUTTING.
std::vector<std::string> liveEffects(const SceneModel& model);

/// Refuses a scene that is stiffer along the needle than the device can render (FORCE_MODEL.md, "Device
/// limits"); lowerForDevice handles the stiffness across it. A device that renders no force accepts every
/// scene. Errors: kInvalidInput, with the numbers.
Status checkStiffness(const SceneModel& model, const DeviceInfo& device);

/// Returns why passivity is not proven, with the numbers; nothing if it is. It is proven if the scene's
/// stiffness along and across the needle is at most b/(T(½ + delay)), which is stable with any hand, and its
/// stiffness about the handle at most the device's limit, scaled by this delay relative to one tick's.
std::optional<std::string> unprovenPassivity(const StationLesson& lesson, const DeviceInfo& device,
                                             const LoopDelay& delay, const Pose& X_HT);

/// Returns the scene as `device` can render it. Turns the orientation limit off if the device renders no
/// torque or measures no orientation. A device that renders nothing at all, such as a recording, keeps the
/// limit: the engine computes it for the record. Adds omissions and assumptions to `notes`.
SceneSpec forDevice(SceneSpec scene, const DeviceInfo& device, std::vector<std::string>& notes);

/// Lowers `lesson.scene` to what the device can hold (FORCE_MODEL.md, "Device limits"), with notes in
/// `notes`: what acts at once along the needle to what is stable behind this delay in the lightest grip;
/// fixture, bone and orientation limit to what it holds with the tool's lever, or the former, if that is
/// less. If the lever would leave less than kMinStiffnessShare, first omits what the needle can do without
/// (BONE). A device that renders no force has no limit; one without torque does not render the lever.
/// `lesson.model` may then be another than the scene's. Errors: kInvalidInput, with the numbers, if less than
/// kMinStiffnessShare is left of either, or a model without a wall would have to be lowered.
Status lowerForDevice(StationLesson& lesson, const DeviceInfo& device, const LoopDelay& delay,
                      const Pose& X_HT, std::vector<std::string>& notes);

/// Returns the settings of passivity control for a device.
PassivitySettings passivityOf(const DeviceInfo& device, const LoopDelay& delay);

/// Adds to `notes` how this device uses the tool.
void noteTool(const Pose& X_HT, const DeviceInfo& device, std::vector<std::string>& notes);

/// Adapts `lesson`'s scene and model to the device, with all notes; one says if the delay is assumed. Turns
/// passivity control on if passivity is not proven or --passivity-control is given. Errors: kInvalidInput.
Status fitLesson(StationLesson& lesson, const DeviceInfo& device, const LoopDelay& delay,
                 const StationOptions& options, std::vector<std::string>& notes);

}  // namespace needlelab
