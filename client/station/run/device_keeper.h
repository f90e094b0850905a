/// Looks after the device beside the loop: whatever may take its time, such as finding a lost device again.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

#include "client/device/device.h"

namespace needlelab {

/// Calls Device::maintain and Device::status about 20 times a second on a thread of its own, so that a slow
/// one holds up neither the loop nor a stop. Thread: made and destroyed by one; `words` by any.
class DeviceKeeper {
 public:
  /// `device` is open, and outlives the keeper.
  explicit DeviceKeeper(Device& device);
  /// Waits for a `maintain` that is under way.
  ~DeviceKeeper();
  DeviceKeeper(const DeviceKeeper&) = delete;
  DeviceKeeper& operator=(const DeviceKeeper&) = delete;

  /// What the device said of itself at the last look.
  [[nodiscard]] std::string words() const;

 private:
  void run();

  Device& device_;
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;
  std::string words_;
  std::thread thread_;
};

}  // namespace needlelab
