#include "client/device/rehearsed_fault.h"

#include <cmath>

#include "common/haptics/gate/force_gate.h"

namespace needlelab {

Status RehearsedFault::open(double rate_hz) {
  constexpr double kLasts_s = 0.5;
  tick_ = 0;
  begun_ = false;
  from_ = static_cast<std::uint64_t>(std::llround(at_s_ * rate_hz));
  until_ = from_ + static_cast<std::uint64_t>(std::llround(kLasts_s * rate_hz));
  return device_->open(rate_hz);
}

DeviceRead RehearsedFault::read(DeviceReading& reading) noexcept {
  // a device without conditions does not change this field
  if (tick_ == until_) reading.condition &= ~kDeviceTrouble;
  const DeviceRead done = device_->read(reading);
  if (tick_ >= from_ && tick_ < until_) {
    reading.condition |= kDeviceTrouble;
    begun_.store(true, std::memory_order_relaxed);
  }
  ++tick_;
  return done;
}

std::string RehearsedFault::status() {
  std::string text = device_->status();
  if (text.empty() && begun_.load(std::memory_order_relaxed)) text = "a rehearsed fault: the device is well";
  return text;
}

}  // namespace needlelab
