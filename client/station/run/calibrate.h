/// `needlelab-station --calibrate`: the needle's tip in the handle's frame, by pivoting in a dimple.
///
/// Pivoting finds the tip only. The needle's direction has to come from elsewhere (`--axis`):
/// - `from-tip`: along the line from the handle's origin to the tip. Right where the needle's axis passes
///   through the handle's origin, as on a syringe mock that is mounted in line with the handle;
/// - `given`: as the orientation in `--tool` says (without --tool: along the handle's +z), e.g. from a
/// drawing;
/// - `hub:FILE`: along the line from the needle's hub to the tip. FILE is the tool file of an earlier
///   calibration, done with the needle off and the hub's cone in the dimple.
/// The turn about the needle's own axis is taken over from --tool: it matters for a bevel only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "client/device/device.h"
#include "client/device/pivot.h"
#include "client/station/run/options.h"
#include "client/station/run/zero_force_loop.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

struct NeedleAxis {
  enum class Source : std::uint8_t { kFromTip, kGiven, kHub };
  Source source = Source::kFromTip;
  Vec3 p_HH_m;  ///< kHub: the hub in the handle's frame
};
/// Errors: kInvalidInput: another text; a hub's file that cannot be read.
Result<NeedleAxis> parseNeedleAxis(const std::string& text);
std::string needleAxisText(const NeedleAxis& axis);

/// The tool: origin at `p_HT_m`, +z along the axis, turned as little as possible against `given`. Errors
/// (kFailed): tip and handle's origin, or tip and hub, nearer than 20 mm: no direction.
Result<Pose> toolOf(Vec3 p_HT_m, const NeedleAxis& axis, const Pose& given);

struct CalibrationSettings {
  double rate_hz = 1000;
  double seconds = 30;    ///< at most; (0, 600]
  double settle_s = 3;    ///< before it, to find the dimple; not used
  double enough_s = 15;   ///< ends after this time when the swing was twice wide enough
  bool real_time = true;  ///< false: for devices that live by the tick
};

struct Calibration {
  PivotFit fit;
  /// Distance between the tips of the first and the second half of the run: more than noise explains is the
  /// device's own error, or play. None when a half alone does not suffice.
  std::optional<double> halves_apart_m;
};

/// Progress for a person while the handle is swung.
struct CalibrationProgress {
  double t_s = 0;  ///< negative while it settles
  std::size_t poses = 0;
  double spread = 0;  ///< as PivotSums::spread
  std::optional<double> residual_rms_m;
};

/// Reads the open device (zero force all the time) and fits. Errors: kUnavailable: the device gave no poses,
/// with its status; kFailed: stopped by a signal, or as of fitPivot.
Result<Calibration> calibrateTip(Device& device, LoopClock& clock, const CalibrationSettings& settings,
                                 const sigset_t& stop_signals,
                                 const std::function<void(const CalibrationProgress&)>& progress);

/// Origin of a tool, for people who open the file later. Lessons do not read it.
struct ToolNotes {
  std::int64_t made_unix_ns = 0;
  std::string device;  ///< DeviceInfo::name
  std::string axis;    ///< the source of the needle's direction, as text
  std::size_t samples = 0, used = 0;
  double residual_rms_m = 0, residual_max_m = 0;
  double expected_error_m = 0;  ///< of the tip in use, two standard deviations
  double tool_error_m = 0;      ///< of it the tool's: two standard deviations in the worst direction
  double spread = 0;            ///< as PivotFit::spread
};

/// The JSON of `poseOptionJson` with a "calibration" object beside the pose, which the reader skips.
std::string toolFileText(const Pose& X_HT, const ToolNotes& notes);

/// `--calibrate`. Exit code 0 when a tool was found and written, 1 when not, 2 for wrong input.
int runCalibrate(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
