/// Exports samples as text for other programs: CSV rows, or one JSON object per sample.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// `t_s,tick,time_ns,px_m,…,fault` and a line feed. Column names carry their unit. Stable: columns are only
/// added at the end.
void appendSampleCsvHeader(std::string& out);

/// One row and a line feed: 17 significant digits, `nan` for not-a-number. `first_time_ns` is the time of the
/// recording's first sample: t_s is the difference of the integer times, so that it is exact to the
/// nanosecond.
void appendSampleCsvRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns);

/// One JSON object with the CSV's names as keys, no line feed; not-a-number and infinities become null,
/// because JSON does not have them.
void appendSampleJson(std::string& out, const GestureSample& sample, std::int64_t first_time_ns);

/// Whether the wall's columns are required and read. Scores do not need them.
enum class WallColumns : std::uint8_t { kLeftOut, kRead };

/// Reads the samples of an exported CSV. A wall that is left out is NaN; time_ns is exact up to 2^53 ns.
/// Errors: those of readCsv; kInvalidInput naming line and column, when a cell does not fit its column.
Result<std::vector<GestureSample>> readSampleCsv(const std::filesystem::path& path,
                                                 WallColumns wall = WallColumns::kLeftOut);

}  // namespace needlelab
