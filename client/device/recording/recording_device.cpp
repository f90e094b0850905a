#include "client/device/recording/recording_device.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "common/base/range.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxTicks = 14'400'000;  // 4 h at 1 kHz; 64 bytes each, even with few rows

}  // namespace

RecordingDevice::RecordingDevice(PoseTrack track, const std::string& name) : track_(std::move(track)) {
  info_.name = "recording " + name;
  info_.renders_force = false;
  info_.renders_torque = false;
  info_.plunger = track_.plunger.empty() ? PlungerSource::kNone : PlungerSource::kAnalog;
}

Status RecordingDevice::open(double rate_hz) {
  const double ticks = (track_.t_s.back() - track_.t_s.front()) * rate_hz;
  if (!(ticks < static_cast<double>(kMaxTicks)))
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{} lasts {} ticks at {} Hz; at most {} can be played", info_.name,
                             numberText(ticks), numberText(rate_hz), kMaxTicks)};
  if (rate_hz != rate_hz_) {
    poses_ = resamplePoses(track_, rate_hz);
    plunger_ = resamplePlunger(track_, rate_hz);
    rate_hz_ = rate_hz;
  }
  next_ = 0;
  return {};
}

DeviceRead RecordingDevice::read(DeviceReading& reading) noexcept {
  if (next_ >= poses_.size()) return DeviceRead::kFinished;
  reading.X_WH = poses_[next_];
  // a recording has no measured speed; the gate checks the tip's
  reading.speed_mps = 0;
  reading.plunger = plunger_.empty() ? 0 : plunger_[next_];
  reading.buttons = 0;
  ++next_;
  return DeviceRead::kFresh;
}

std::uint64_t RecordingDevice::skip(std::uint64_t ticks) noexcept {
  const std::uint64_t recorded = std::min<std::uint64_t>(ticks, poses_.size() - next_);
  next_ += static_cast<std::size_t>(recorded);
  return recorded;
}

}  // namespace needlelab
