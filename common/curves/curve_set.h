/// A set of recorded force curves from a folder: CSV files and facts about them
/// (common/python/examples/FIT.md has the format). Files are not trusted.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/curves/curve_phases.h"
#include "common/curves/force_curve.h"

namespace needlelab {

struct CurveSet {
  std::string name, licence, source;
  std::vector<ForceCurve> curves;            ///< ordered by tissue, specimen, needle, speed, name
  std::vector<std::string> notes;            ///< omissions, and their reasons
  std::vector<std::filesystem::path> files;  ///< the files that were read
};

/// Reads the folder's *.csv and *.txt, in any case; hidden and other files are named in a note. Curves with
/// the same numbers count once. Facts about them come from their columns, from `description` (a file), or, if
/// that is empty, from the folder's data_set.json or a built-in description (known/). A file that no
/// description names and that lacks a column is omitted with a note. Errors (kInvalidInput) name file, line,
/// column or field, value, and the allowed values: everything that FIT.md rejects; a missing described
/// file; no curves at all.
Result<CurveSet> readCurveSet(const std::filesystem::path& folder,
                              const std::filesystem::path& description = {},
                              const CurveReading& reading = {});

/// How to read a folder, as programs in other languages say it.
struct CurveOptions {
  std::filesystem::path description;
  CurveReading reading;
};
/// A JSON object with any of `describe` (a file), `encoding`, `lines_above`, `force_unit` ("N", "mN", "gf",
/// "kgf"), `negate` (a list of "depth", "force"), `tare`, `digitised`. Errors (kInvalidInput) name field,
/// value and the allowed values.
Result<CurveOptions> parseCurveOptions(std::string_view json);

/// All rows of a curve one after the other: in, at rest, out.
struct CurveColumns {
  std::vector<double> depth_m, force_N;
  std::vector<double> t_s;  ///< since the first row, at the curve's mean speeds
  std::vector<CurvePhase> phase;
};
CurveColumns columnsOf(const ForceCurve& curve);

// --- one CSV file of force curves, with the phases of each; not trusted

/// Facts about a file's curves besides its columns; empty or 0 if unknown.
struct CurveFacts {
  std::string file, specimen, needle, tissue;
  double speed_mps = 0, diameter_m = 0, insertion_s = 0;
  bool digitised = false;  ///< points from a figure, in any order
};

struct CurveFileContent {
  std::vector<ForceCurve> curves;
  std::string missing;  ///< what neither columns nor facts give, as text; then there are no curves
};

/// Returns all curves of the file; reduces `rows_left` by the rows read. Errors (kInvalidInput) name file,
/// line, column and value.
Result<CurveFileContent> readCurveFile(const std::filesystem::path& path, const CurveFacts& facts,
                                       const CurveReading& reading, std::size_t& rows_left);

}  // namespace needlelab
