/// Poses on a command line: the options `--tool` and `--placement` of all programs.
#pragma once

#include <string>

#include "common/base/plausible.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Reads `x,y,z,qx,qy,qz,qw` (metres, unit quaternion), or the JSON file of that name: `{"position_m": {"x":
/// 0, "y": 0, "z": 0.15}, "quaternion": {"x": 0, "y": 0, "z": 0, "w": 1}}`. Ignores an additional
/// "calibration" object (ToolNotes in calibrate.h). `option` names it in messages, e.g. "--tool". The
/// quaternion is normalised. Errors: kInvalidInput: not seven finite numbers, a distance from the origin
/// beyond `reach`'s row, | |q| − 1 | above 1e-3, a wrong or missing field.
Result<Pose> parsePoseOption(const std::string& text, const std::string& option,
                             Quantity reach = Quantity::kTool);

/// Returns seven numbers with commas; `parsePoseOption` reads them back bit for bit.
std::string poseOptionText(const Pose& pose);
/// Returns the JSON file's content, with a newline at the end.
std::string poseOptionJson(const Pose& pose);

}  // namespace needlelab
