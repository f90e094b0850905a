/// Reads a recording for uses that a hole would falsify: a score, a device that plays it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// A recording's contents and holes.
struct ReadRecording {
  std::vector<GestureSample> samples;  ///< all that can be read, in the file's order
  std::vector<std::string> holes;      ///< each names ticks (from–to) and the reason; empty: it is whole
  double rate_hz = 0;                  ///< from its metadata; 0: not given
  std::string metadata;                ///< JSON
  std::vector<Bytes> paths;            ///< lists of paths in a body (pathsIn), in the file's order
};

/// Whether a damaged recording is refused, or read as far as it goes.
enum class DamagedRecording : std::uint8_t { kRefuse, kRead };

/// The greatest number of samples read from a recording: an hour at 1 kHz, twice what a server scores. A
/// chunk of 8 kB may hold 65,536 samples, so a file's size does not bound the memory and time that its
/// samples take.
inline constexpr std::uint64_t kMaxReadSamples = 3'600'000;

/// Reads every sample and checks the file against its index (each chunk and its hash) and its metadata, if
/// they name `samples`, `chunks` and `hash` of the export. (With `part`, an export of part of a session,
/// these are the session's and are not compared.) Takes some 200 bytes of memory per sample, and at most some
/// 50 MB for the metadata. Errors: from RecordingReader::open; kInvalidInput, before decoding, if its chunks
/// declare more than kMaxReadSamples; kCorrupt with the first hole and the number of readable samples:
/// always with kRefuse, with kRead if no sample can be read.
Result<ReadRecording> readRecording(const std::filesystem::path& path,
                                    DamagedRecording damaged = DamagedRecording::kRefuse);

/// As readRecording, for a caller that needs only part of each sample: passes on the samples of one chunk
/// after the other, in the file's order, and keeps none. The first error of `each` ends the reading. Returns
/// the holes. If the recording is refused, the samples passed on must not be used.
Result<std::vector<std::string>> readRecordingByChunk(
    const std::filesystem::path& path, DamagedRecording damaged,
    const std::function<Status(std::span<const GestureSample>)>& each);

/// The median duration of a tick; 0 with fewer than two samples.
double tickOf_s(std::span<const GestureSample> samples);
/// A station's rate is a whole number of ticks per second, but its times are not exact; 0: it is none.
double wholeRate_hz(double tick_s);

/// Returns whether the file begins as a recording does; ignores its name.
bool beginsAsRecording(const std::filesystem::path& path);

}  // namespace needlelab
