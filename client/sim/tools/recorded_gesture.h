/// What a device recorded: a recording, or its samples as CSV (session export); input of `run` and `score`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/device/whole_recording.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/gesture/sample_csv.h"

namespace needlelab {

struct RecordedGesture {
  std::vector<GestureSample> samples;  ///< at least one; ticks and times ascend
  std::vector<std::string> holes;      ///< of a damaged one; empty: it is whole
  double rate_hz = 0;                  ///< as the file says it
};

/// The rate is that of the metadata, else that of ticks and times. `rate_hz`: what the caller expects;
/// nothing: what the file says. Errors: those of readRecording and readSampleCsv; kInvalidInput, with the
/// row, for ticks or times that do not ascend, for another rate than `rate_hz`, and where the file tells
/// none; kCorrupt for ticks that are missing in a CSV (more than three of the usual steps, and 0.1 s), unless
/// `damaged` is kRead.
Result<RecordedGesture> readRecordedGesture(const std::filesystem::path& path, DamagedRecording damaged,
                                            WallColumns wall, std::optional<double> rate_hz);

}  // namespace needlelab
