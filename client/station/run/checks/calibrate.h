/// `needlelab-station --calibrate`: finds the needle's tip in the handle's frame by pivoting in a dimple.
///
/// Pivoting finds only the tip. `--axis` gives the needle's direction:
/// - `from-tip`: along the line from the handle's origin to the tip. This is correct if the needle's axis
///   passes through the handle's origin, as on a syringe mock mounted in line with the handle;
/// - `given`: the orientation in `--tool` (without --tool: along the handle's +z), e.g. from a drawing;
/// - `hub:FILE`: along the line from the needle's hub to the tip. FILE is the tool file of an earlier
///   calibration, done with the needle off and the hub's cone in the dimple.
/// --tool gives the rotation about the needle's own axis, which matters only for a bevel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "client/device/device.h"
#include "client/device/pivot.h"
#include "client/station/run/io/options.h"
#include "client/station/run/loop/zero_force_loop.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

struct NeedleAxis {
  enum class Source : std::uint8_t { kFromTip, kGiven, kHub };
  Source source = Source::kFromTip;
  Vec3 p_HH_m;  ///< kHub: the hub in the handle's frame
};
/// Errors: kInvalidInput (unknown text, unreadable hub file).
Result<NeedleAxis> parseNeedleAxis(const std::string& text);
std::string needleAxisText(const NeedleAxis& axis);

/// Returns the tool: origin at `p_HT_m`, +z along the axis, with the smallest possible rotation from `given`.
/// Errors: kFailed if the tip is within 20 mm of the handle's origin or of the hub: too near to give a
/// direction.
Result<Pose> toolOf(Vec3 p_HT_m, const NeedleAxis& axis, const Pose& given);

struct CalibrationSettings {
  double rate_hz = 1000;
  double seconds = 30;    ///< longest duration; (0, 600]
  double settle_s = 3;    ///< time before the measurement, to find the dimple; its samples are not used
  double enough_s = 15;   ///< ends after this time if the swing is twice as wide as needed
  bool real_time = true;  ///< false: for devices that advance by ticks, not by time
};

struct Calibration {
  PivotFit fit;
  /// Distance between the tips fitted to the first and to the second half of the run. More than the noise
  /// means device error or play. None if half a run is too short for a fit.
  std::optional<double> halves_apart_m;
};

/// Progress for a person during the swing.
struct CalibrationProgress {
  double t_s = 0;  ///< negative while settling
  std::size_t poses = 0;
  double spread = 0;  ///< as PivotSums::spread
  std::optional<double> residual_rms_m;
};

/// Reads the open device at zero force and fits the tip. Errors: kUnavailable (no poses; the message has the
/// device's status), kFailed (stopped by a signal, or from fitPivot). `clock`: the loop's; `time`, `threads`:
/// as in runZeroForceLoop.
Result<Calibration> calibrateTip(Device& device, TimeSource& clock, const CalibrationSettings& settings,
                                 const sigset_t& stop_signals,
                                 const std::function<void(const CalibrationProgress&)>& progress,
                                 TimeSource& time = machineTime(), TurnRunner& threads = machineThreads());

/// The origin of a tool, for later readers of the file. Lessons do not read it.
struct ToolNotes {
  std::int64_t made_unix_ns = 0;
  std::string device;  ///< DeviceInfo::name
  std::string axis;    ///< source of the needle's direction
  std::size_t samples = 0, used = 0;
  double residual_rms_m = 0, residual_max_m = 0;
  double expected_error_m = 0;  ///< error of the tip in use, two standard deviations
  double tool_error_m = 0;      ///< the tool's part of it: two standard deviations in the worst direction
  double spread = 0;            ///< as PivotFit::spread
};

/// Returns the JSON of `poseOptionJson` with an additional "calibration" object. The reader ignores that
/// object.
std::string toolFileText(const Pose& X_HT, const ToolNotes& notes);

/// Runs `--calibrate`. Exit code: 0 if a tool was found and written, 1 if not, 2 for wrong input.
int runCalibrate(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
