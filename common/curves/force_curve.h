/// A recorded force curve, limits on files, and how files are read.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/base/range.h"
#include "common/base/text/csv_rows.h"

namespace needlelab {

/// The needle at rest where its insertion ended; no times if there was no hold.
struct CurveHold {
  double depth_m = 0;
  std::vector<double> t_s, force_N;  ///< time since its start
};

/// The way out; no depths if there was no withdrawal.
struct CurveWithdrawal {
  double speed_mps = 0;  ///< above 0
  std::vector<double> depth_m,
      force_N;  ///< ordered by depth; negative forces hold the needle back
};

/// One insertion of one needle, and what followed.
struct ForceCurve {
  std::string name;  ///< the file, then a colon and the curve's name in it
  std::string specimen, needle, tissue;
  double speed_mps = 0;
  double diameter_m = 0;                 ///< of the needle, outer; 0 if unknown
  std::vector<double> depth_m, force_N;  ///< ordered by depth; positive pushes the needle out
  CurveHold hold;
  CurveWithdrawal withdrawal;
  bool phases_recognised = false;  ///< from depth and time, without a column
  double zero_N = 0;               ///< mean force above the skin, if it is not 0 (curve_zero.h)
  double zero_drift_N = 0;         ///< by which the zero goes on from the first row to the last
};

// limits on files
inline constexpr NumberRange kCurveDepth_m{-0.05, 1};
inline constexpr NumberRange kCurveForce_N{-100, 100};
inline constexpr NumberRange kCurveTime_s{0, 3600};
inline constexpr NumberRange kCurveSpeed_mps{1e-4, 1};
inline constexpr NumberRange kCurveDiameter_m{0, 0.01, true};
inline constexpr std::size_t kMaxCurveBytes = 64u << 20, kMaxCurveFiles = 500, kMaxCurves = 1000;
inline constexpr std::size_t kMaxCurveRows = 2'000'000;  ///< of all files together
inline constexpr std::size_t kMinCurveRows = 8;          ///< per phase
inline constexpr double kMinCurveDepth_m = 0.002;        ///< of a way in or out
inline constexpr double kMinHold_s = 0.2, kMaxHold_s = 600, kMaxHoldWay_m = 0.001;

/// How to read files that were not written for this program. CurveSet::notes lists the changes.
struct CurveReading {
  std::size_t lines_above = 0;                      ///< lines above the header, as instruments write them
  bool digitised = false;                           ///< the rows are points from a figure, in any order
  bool negate_depth = false, negate_force = false;  ///< the file uses the opposite sign
  TextEncoding encoding = TextEncoding::kUnicode;
  double force_unit_N = 0;  ///< what 1 in the column `force_n` is; 0: 1 N, if that is plausible
  bool tare = false;        ///< takes the force above the skin off
};

}  // namespace needlelab
