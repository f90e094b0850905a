/// Poses over time, from a CSV or a recording, and at the ticks of a loop.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Poses with their recorded times. All vectors have the same length, at least 1; times ascend.
struct PoseTrack {
  std::vector<double> t_s;
  std::vector<Pose> X_WH;          ///< of the handle; unit quaternions
  std::vector<double> plunger;     ///< 0-1; empty when the file has no such column
  std::vector<std::string> holes;  ///< that straight lines bridge, for people
};

struct TrackReading {
  std::size_t lines_above = 0;  ///< lines to skip above the header
  bool bridges_holes = false;   ///< otherwise a hole is an error
};

/// Two rows of a file are at most three of its usual periods apart, or this time if that is longer, because a
/// computer's device may be that late. Longer gaps are holes.
inline constexpr double kMaxGap_s = 0.01;
inline constexpr double kOnTick_s = 1e-9;  ///< rows this close to a tick are used unchanged

/// Reads a CSV with the columns `t_s,px_m,py_m,pz_m,qx,qy,qz,qw` and optionally `plunger`, in any order.
/// Normalises quaternions with | |q| − 1 | ≤ 1e-3. Errors (kInvalidInput) name file, line, column, value and
/// range: from readCsv; a quaternion off unit length, a time that does not ascend or jumps (kMaxGap_s), a
/// plunger outside 0-1, a position beyond 1 km; a way or a step of time that looks like another unit
/// (common/base/plausible.h).
Result<PoseTrack> readPoseTrack(const std::filesystem::path& path, const TrackReading& reading = {});

/// Reads a recording (common/gesture/FORMAT.md): converts its tips' poses to the handle's with the present
/// tool (X_HT: the tip in the handle's frame), counts times from its first sample on the station's clock, and
/// clamps the plunger to 0-1. At most an hour at 1 kHz, decoded chunk by chunk. Errors: from readRecording,
/// and as readPoseTrack with the sample instead of the line; kInvalidInput without samples.
Result<PoseTrack> readRecordedTrack(const std::filesystem::path& path, const Pose& X_HT);

/// Returns the number of ticks of a track at `rate_hz`: the times t_first + k/rate up to the last row.
std::size_t tickCount(const PoseTrack& track, double rate_hz);

/// Returns the track's poses at the ticks t_first + k/rate, k = 0 … tickCount − 1. Between two rows the
/// position is linear in time and the orientation is interpolated linearly on the shorter way and normalised
/// (nlerp: rows are about 1 ms apart, where it differs from slerp by less than 1e-7 rad). A row within 1 ns
/// of a tick is used unchanged, bit for bit, so that a track recorded on the ticks plays back unchanged.
std::vector<Pose> resamplePoses(const PoseTrack& track, double rate_hz);
/// Returns the plunger in the same way; empty when the track has none.
std::vector<double> resamplePlunger(const PoseTrack& track, double rate_hz);

}  // namespace needlelab
