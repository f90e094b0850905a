/// Compares the two stop modes (FORCE_MODEL.md, "Tracking wall") with the recorded relaxation of a needle
/// held still in tissue, and the attracted force with the following withdrawal.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "client/sim/curves/curve_fit.h"

namespace needlelab {

// Time ranges of insert_hold_withdraw.csv, in s. The peak at 1.9 s and the fall after it precede the hold.
inline constexpr double kHoldFrom_s = 2.2, kHoldTo_s = 9.85, kWithdrawalTo_s = 11.5;
// Bins and blocks for errors over time, in s.
inline constexpr double kHoldBin_s = 0.1, kHoldBlock_s = 0.5;
inline constexpr double kWithdrawalBin_s = 0.05, kWithdrawalBlock_s = 0.1;

/// Axial force on the needle at a time; positive pushes the needle out.
struct ForceAtTime {
  double t_s = 0, force_N = 0;
};
/// Reads the columns t_s and force_n, ordered by time. Errors: those of `readCsv`.
Result<std::vector<ForceAtTime>> readForceOverTime(const std::filesystem::path& file);

/// The rows of a time range, and their means over equal intervals.
struct TimeCurve {
  std::vector<double> t_s, force_N;
  std::vector<CurveBin> bins;
};
TimeCurve holdOf(const std::vector<ForceAtTime>& rows);
TimeCurve withdrawalOf(const std::vector<ForceAtTime>& rows);

/// A stop fitted to a hold, and the resulting force of the engine over time.
struct HoldFit {
  StopMode mode = StopMode::kExponential;
  double force_N = 0;            ///< when the needle comes to rest: cutting force of the scene's only layer
  double relax_time_s = 0;       ///< EXPONENTIAL
  double relax_residual = 0;     ///< EXPONENTIAL
  double stop_duration_s = 0;    ///< RAMP
  double rejection_force_N = 0;  ///< RAMP
  CurveError fitted, held_out;
  SceneSpec scene;    ///< with these numbers
  double from_s = 0;  ///< time of the first tick
  StraightGesture gesture;
  AxialRun run;
  int evaluations = 0;
};

/// Selects the blocks of kHoldBlock_s to fit on; the others are held out.
using BlockChoice = std::function<bool(int block)>;

/// Fits the force and the mode's two numbers to the rows within the hold, through the engine: the needle goes
/// in at 3 mm/s and rests from kHoldFrom_s. Errors: those of `compile`; kInvalidInput without rows.
Result<HoldFit> fitHold(const std::vector<ForceAtTime>& rows, StopMode mode, const BlockChoice& fit_on);

/// The withdrawal with the wall's single constant attracted force. Speed and depth replace the displacement,
/// which was not recorded: the recording only determines speed·K_t and depth/speed.
struct WithdrawalFit {
  double speed_mps = 0;  ///< with K_t of the fit's scene
  double depth_m = 0;    ///< inserted length at the start of the withdrawal
  double attracted_force_N = 0;
  CurveError fitted, held_out;
  double from_s = 0;
  StraightGesture gesture;
  AxialRun run;
};
/// Fits the rows after the hold, in blocks of kWithdrawalBlock_s. Errors: as `fitHold`.
Result<WithdrawalFit> fitWithdrawal(const std::vector<ForceAtTime>& rows, const HoldFit& hold,
                                    const BlockChoice& fit_on);

/// The engine's force at each row of a time range.
std::vector<double> modelAt(const TimeCurve& curve, const StraightGesture& gesture, const AxialRun& run,
                            double from_s);
/// The engine's force at a time of the recording.
double forceAtTime(const StraightGesture& gesture, const AxialRun& run, double from_s, double t_s);

}  // namespace needlelab
