/// `needlelab-station --calibrate`: the needle's tip in the handle's frame, by pivoting in a dimple.
///
/// Pivoting finds the tip only. Where the needle points has to come from elsewhere (`--axis`):
/// - `from-tip`: along the line from the handle's origin to the tip. Right where the needle's axis passes
///   through the handle's origin, as on a syringe mock that is mounted in line with the handle;
/// - `given`: as the orientation in `--tool` says (without --tool: along the handle's +z), e.g. from a
/// drawing;
/// - `hub:FILE`: along the line from the needle's hub to the tip. FILE is the tool file of an earlier
///   calibration, done with the needle off and the hub's cone in the dimple.
/// The turn about the needle's own axis is taken over from --tool: it matters for a bevel only.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "client/device/device.h"
#include "client/device/pivot.h"
#include "client/station/run/quiet_loop.h"
#include "common/base/result.h"

namespace needlelab {

struct NeedleAxis {
  enum class Source : std::uint8_t { kFromTip, kGiven, kHub };
  Source source = Source::kFromTip;
  Vec3 p_HH_m;  ///< kHub: the hub in the handle's frame
};
/// Errors: kInvalidInput: another word; a hub's file that cannot be read.
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
  bool real_time = true;  ///< false: for what lives by the tick
};

struct Calibration {
  PivotFit fit;
  /// How far the tips of the first and the second half of the run lie apart: what noise cannot explain is the
  /// device's own error, or play. None when a half alone does not tell.
  std::optional<double> halves_apart_m;
};

/// What a person sees while the handle is swung.
struct CalibrationProgress {
  double t_s = 0;  ///< negative while it settles
  std::size_t poses = 0;
  double spread = 0;  ///< as PivotSums::spread
  std::optional<double> residual_rms_m;
};

/// Reads the open device (zero force all the time) and fits. Errors: kUnavailable: the device gave no poses,
/// with its own words; kFailed: stopped by a signal, or as of fitPivot.
Result<Calibration> calibrateTip(Device& device, LoopClock& clock, const CalibrationSettings& settings,
                                 const sigset_t& stop_signals,
                                 const std::function<void(const CalibrationProgress&)>& progress);

}  // namespace needlelab
