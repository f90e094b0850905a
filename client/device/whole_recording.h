/// Reads a recording for a use that a hole would falsify: a score, a device that plays it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// What a recording holds, and what it lacks.
struct ReadRecording {
  std::vector<GestureSample> samples;  ///< all that can be read, in the file's order
  std::vector<std::string> holes;      ///< each names ticks (from–to) and the reason; empty: it is whole
  double rate_hz = 0;                  ///< of its metadata; 0: they say none
};

/// Whether a damaged recording is refused, or read as far as it goes.
enum class DamagedRecording : std::uint8_t { kRefuse, kRead };

/// The most samples of a recording that are read: an hour at 1 kHz, twice what a server scores. A chunk of 8
/// kB may hold 65,536 samples, so the size of a file bounds neither the memory nor the time that its samples
/// take.
inline constexpr std::uint64_t kMostReadSamples = 3'600'000;

/// Reads every sample and holds the file against its index (each chunk, their hash) and against its metadata,
/// where they name `samples`, `chunks` and `hash` of what was exported (with `part`, an export of a part of a
/// session, they are the session's, and are not compared). Takes some 200 bytes of memory a sample,
/// and some 50 MB at most for the metadata. Errors:
/// as of RecordingReader::open; kInvalidInput, before anything is decoded, when its chunks say that they have
/// more than kMostReadSamples; kCorrupt with the first hole and the number of samples that can be read:
/// always with kRefuse, with kRead when no sample can be read.
Result<ReadRecording> readRecording(const std::filesystem::path& path,
                                    DamagedRecording damaged = DamagedRecording::kRefuse);

/// As readRecording, for a caller that needs a part of each sample only: shows the samples of one chunk after
/// the other, in the file's order, and keeps none. The first error of `each` ends the reading. Returns the
/// holes; what was shown of a recording that is refused is not to be used.
Result<std::vector<std::string>> readRecordingByChunk(
    const std::filesystem::path& path, DamagedRecording damaged,
    const std::function<Status(std::span<const GestureSample>)>& each);

/// Whether the file begins as a recording does, whatever its name is.
bool beginsAsRecording(const std::filesystem::path& path);

}  // namespace needlelab
