/// A device that reports a fault once, so that a person can rehearse the reaction.
#pragma once

#include <memory>
#include <string>

#include "client/device/device.h"

namespace needlelab {

/// Like `device`, but reports kDeviceTrouble for half a second from `at_s` on. The fault is the gate's own:
/// the force is removed and returns as after any other.
class RehearsedFault final : public Device {
 public:
  RehearsedFault(std::unique_ptr<Device> device, double at_s) : device_(std::move(device)), at_s_(at_s) {}

  [[nodiscard]] const DeviceInfo& info() const override { return device_->info(); }
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override { device_->write(at_handle_W); }
  std::uint64_t skip(std::uint64_t ticks) noexcept override {
    tick_ += ticks;
    return device_->skip(ticks);
  }
  void maintain() override { device_->maintain(); }
  [[nodiscard]] std::string status() override;
  void close() noexcept override { device_->close(); }

 private:
  std::unique_ptr<Device> device_;
  double at_s_;
  std::uint64_t tick_ = 0, from_ = 0, until_ = 0;  // of the haptic thread while the loop runs
  std::atomic<bool> begun_{false};
};

}  // namespace needlelab
