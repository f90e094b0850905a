/// `recording:FILE`: recorded poses, as if a hand that feels nothing moved the device.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "client/device/device.h"
#include "common/base/result.h"

namespace needlelab {

/// Poses at the times at which they were recorded. All vectors have the same length, at least 1; times never
/// go backwards.
struct PoseTrack {
  std::vector<double> t_s;
  std::vector<Pose> X_WH;       ///< of the handle; unit quaternions
  std::vector<double> plunger;  ///< 0-1; empty when the file has no such column
};

/// Requirement on the times of a track.
enum class TrackTimes : std::uint8_t {
  kAscending,  ///< they may repeat but not go backwards
  kAnyOrder,   ///< they mean nothing: a row is a tick
};

/// Reads a CSV with the columns `t_s,px_m,py_m,pz_m,qx,qy,qz,qw` and perhaps `plunger`, found by name, in any
/// order. Quaternions with | |q| − 1 | ≤ 1e-3 are normalised. Times may repeat. Errors (kInvalidInput) name
/// file, line, column, value and range: as of readCsv; a quaternion off unit length, a time that goes
/// backwards, a plunger outside 0-1, a position beyond 1 km.
Result<PoseTrack> readPoseTrack(const std::filesystem::path& path, TrackTimes times = TrackTimes::kAscending);

/// How many ticks of `rate_hz` a track lasts: those at t_first + k/rate that are not after the last row.
std::size_t tickCount(const PoseTrack& track, double rate_hz);

/// The track at the ticks t_first + k/rate, k = 0 … tickCount − 1. Between two rows the position is linear in
/// time and the orientation is interpolated linearly on the shorter way and normalised (nlerp: rows are about
/// 1 ms apart, where it differs from slerp by less than 1e-7 rad). Of rows with the same time the last
/// counts. A row within 1 ns of a tick is taken as it is, bit for bit, so that a track that was recorded on
/// the ticks is played unchanged.
std::vector<Pose> resamplePoses(const PoseTrack& track, double rate_hz);
/// The plunger in the same way; empty when the track has none.
std::vector<double> resamplePlunger(const PoseTrack& track, double rate_hz);

/// Plays a track from its first row on, one tick a read. A tick that the loop missed is skipped in the
/// recording too, so that tick k of a session always has the pose of tick k of the track. Renders no force.
class RecordingDevice final : public Device {
 public:
  /// `name` stands in DeviceInfo, e.g. the file's name.
  RecordingDevice(PoseTrack track, const std::string& name);

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench&) noexcept override {}
  void skip(std::uint64_t ticks) noexcept override;
  void close() noexcept override {}

 private:
  DeviceInfo info_;
  PoseTrack track_;
  std::vector<Pose> poses_;
  std::vector<double> plunger_;
  double rate_hz_ = 0;
  std::size_t next_ = 0;
};

}  // namespace needlelab
