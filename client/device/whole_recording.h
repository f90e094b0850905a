/// Reads a recording for a use that a hole would falsify: a score, a device that plays it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// What a recording holds, and what it lacks.
struct ReadRecording {
  std::vector<GestureSample> samples;  ///< all that can be read, in the file's order
  std::vector<std::string> holes;      ///< each names ticks (from–to) and the reason; empty: it is whole
};

/// Whether a damaged recording is refused, or read as far as it goes.
enum class DamagedRecording : std::uint8_t { kRefuse, kRead };

/// Reads every sample and holds the file against its index (each chunk, their hash) and against its metadata,
/// where they name `samples`, `chunks` and `hash` of what was exported (with `part`, an export of a part of a
/// session, they are the session's, and are not compared). Errors: as of RecordingReader::open; kCorrupt with
/// the first hole and the number of samples that can be read: always with kRefuse, with kRead when no sample
/// can be read.
Result<ReadRecording> readRecording(const std::filesystem::path& path,
                                    DamagedRecording damaged = DamagedRecording::kRefuse);

/// Whether the file begins as a recording does, whatever its name is.
bool beginsAsRecording(const std::filesystem::path& path);

}  // namespace needlelab
