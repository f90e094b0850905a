/// A set of recorded force curves from a folder: CSV files, and what is known of them (README.md has the
/// format). Files are not trusted.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/range.h"
#include "common/base/result.h"

namespace needlelab {

/// The needle at rest where its insertion ended; no times: there was none.
struct CurveHold {
  double depth_m = 0;
  std::vector<double> t_s, force_N;  ///< time since its beginning
};

/// The way out; no depths: there was none.
struct CurveWithdrawal {
  double speed_mps = 0;  ///< above 0
  std::vector<double> depth_m,
      force_N;  ///< in order of depth; a needle that is held back has negative forces
};

/// One insertion of one needle, and what came behind.
struct ForceCurve {
  std::string name;  ///< the file, and behind a colon the curve's name in it
  std::string specimen, needle, tissue;
  double speed_mps = 0;
  double diameter_m = 0;                 ///< of the needle, outer; 0: not known
  std::vector<double> depth_m, force_N;  ///< in order of depth; positive pushes the needle out
  CurveHold hold;
  CurveWithdrawal withdrawal;
  bool phases_recognised = false;  ///< by depth and time: no column said them
};

struct CurveSet {
  std::string name, licence, source;
  std::vector<ForceCurve> curves;            ///< in order of tissue, specimen, needle, speed, name
  std::vector<std::string> notes;            ///< what was left out, and why
  std::vector<std::filesystem::path> files;  ///< that were read
};

// what a file may hold
inline constexpr NumberRange kCurveDepth_m{-0.05, 1};
inline constexpr NumberRange kCurveForce_N{-100, 100};
inline constexpr NumberRange kCurveTime_s{0, 3600};
inline constexpr NumberRange kCurveSpeed_mps{1e-4, 1};
inline constexpr NumberRange kCurveDiameter_m{0, 0.01, true};
inline constexpr std::size_t kMostCurveBytes = 64u << 20, kMostCurveFiles = 500, kMostCurves = 1000;
inline constexpr std::size_t kMostCurveRows = 2'000'000;  ///< of all files together
inline constexpr std::size_t kLeastCurveRows = 8;         ///< of a phase
inline constexpr double kLeastCurveDepth_m = 0.002;       ///< of a way in or out
inline constexpr double kLeastHold_s = 0.2, kMostHold_s = 600, kMostHoldWay_m = 0.001;

/// How files are read that were not written for this program. What it changes is said in CurveSet::notes.
struct CurveReading {
  std::size_t lines_above = 0;                      ///< lines above the header, which an instrument writes
  bool digitised = false;                           ///< the rows are points of a figure, in any order
  bool negate_depth = false, negate_force = false;  ///< the file counts them the other way
};

/// Reads the folder's *.csv. What is known of them stands in their columns, in `description` (a file), or, if
/// that is empty, in the folder's data_set.json, or in a description that is built in (known/). A file that
/// no description names and that lacks a column is left out with a note. Errors (kInvalidInput) name file,
/// line, column or field, value, and what would be right: all that README.md refuses; a described file that
/// is not there; no curve at all.
Result<CurveSet> readCurveSet(const std::filesystem::path& folder,
                              const std::filesystem::path& description = {},
                              const CurveReading& reading = {});

}  // namespace needlelab
