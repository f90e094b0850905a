/// A lesson on the device that is there: what it cannot render or measure is left out or assumed, and said.
#pragma once

#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/station/run/lesson.h"
#include "common/base/result.h"

namespace needlelab {

/// The scene as `device` can render it. The orientation limit is not live where no torque is rendered (a
/// device that renders nothing at all, such as a recording, keeps it: it is computed for the record) or no
/// orientation is measured. Adds to `notes` what was left out or assumed, in plain words.
SceneSpec forDevice(SceneSpec scene, const DeviceInfo& device, std::vector<std::string>& notes);

/// What becomes of the tool on such a device, in plain words: adds to `notes`.
void noteTool(const Pose& X_HT, const DeviceInfo& device, std::vector<std::string>& notes);

/// Makes `lesson`'s scene and model those for the device, with all notes. Errors: kInvalidInput.
Status fitLesson(StationLesson& lesson, const DeviceInfo& device, const StationOptions& options,
                 std::vector<std::string>& notes);

}  // namespace needlelab
