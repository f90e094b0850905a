/// One CSV file of force curves: columns to curves, with the phases of each. The file is not trusted.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "client/sim/benchmark/curve_set.h"
#include "common/base/result.h"

namespace needlelab {

/// What is known of a file's curves beside its columns; empty or 0: not said.
struct CurveFacts {
  std::string file, specimen, needle, tissue;
  double speed_mps = 0, diameter_m = 0;
  bool digitised = false;  ///< points of a figure, in any order
};

struct CurveFileContent {
  std::vector<ForceCurve> curves;
  std::string missing;  ///< what neither columns nor facts say, as text; then there are no curves
};

/// All curves of the file; `rows_left` is lowered by the rows read. Errors (kInvalidInput) name file, line,
/// column and value.
Result<CurveFileContent> readCurveFile(const std::filesystem::path& path, const CurveFacts& facts,
                                       const CurveReading& reading, std::size_t& rows_left);

}  // namespace needlelab
