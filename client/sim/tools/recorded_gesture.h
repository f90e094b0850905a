/// A device's recording, or its samples as CSV (session export): input of `run` and `score`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/device/recording/whole_recording.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/gesture/sample_csv.h"

namespace needlelab {

struct RecordedGesture {
  std::vector<GestureSample> samples;  ///< at least one; ticks and times ascend
  std::vector<std::string> holes;      ///< in a damaged one; empty if complete
  double rate_hz = 0;                  ///< as given in the file
};

/// The rate comes from the metadata, otherwise from ticks and times. `rate_hz`: the rate that the caller
/// expects; empty: any. Errors: those of readRecording and readSampleCsv; kInvalidInput, with the row, for
/// ticks or times that do not ascend, for a rate other than `rate_hz`, and if the file gives none; kCorrupt
/// for missing ticks in a CSV (more than three of the usual steps, and 0.1 s), unless `damaged` is kRead.
Result<RecordedGesture> readRecordedGesture(const std::filesystem::path& path, DamagedRecording damaged,
                                            WallColumns wall, std::optional<double> rate_hz);

}  // namespace needlelab
