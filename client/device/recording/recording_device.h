/// The device `recording:FILE`: plays recorded poses, without feedback from the forces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "common/gesture/pose_track.h"

namespace needlelab {

/// Plays a track from its first row, one tick per read. Skips the loop's missed ticks in the recording too,
/// so that tick k of a session always has the pose of tick k of the track. Renders no force.
class RecordingDevice final : public Device {
 public:
  /// `name` is used for DeviceInfo, e.g. the file's name.
  RecordingDevice(PoseTrack track, const std::string& name);

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench&) noexcept override {}
  std::uint64_t skip(std::uint64_t ticks) noexcept override;
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
