/// The tool file that `--calibrate` writes and `--tool` reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/haptics/geometry.h"

namespace needlelab {

/// Where a tool came from, for whoever opens the file later. None of it is read by a lesson.
struct ToolNotes {
  std::int64_t made_unix_ns = 0;
  std::string device;  ///< DeviceInfo::name
  std::string axis;    ///< what the needle's direction was taken from, in words
  std::size_t samples = 0, used = 0;
  double residual_rms_m = 0, residual_max_m = 0;
  double expected_error_m = 0;  ///< of the tip in use, two standard deviations
  double tool_error_m = 0;      ///< of it the tool's: two standard deviations in the worst direction
  double spread = 0;            ///< as PivotFit::spread
};

/// The JSON of `poseOptionJson` with a "calibration" object beside the pose, which the reader skips.
std::string toolFileText(const Pose& X_HT, const ToolNotes& notes);

}  // namespace needlelab
