/// Reads one CSV file of force curves, with the phases of each. The file is not trusted.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "client/sim/benchmark/force_curve.h"
#include "common/base/result.h"

namespace needlelab {

/// Facts about a file's curves besides its columns; empty or 0 if unknown.
struct CurveFacts {
  std::string file, specimen, needle, tissue;
  double speed_mps = 0, diameter_m = 0;
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
