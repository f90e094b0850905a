/// Our device `falcon` on the emulated USB, driven by ticks as the station's loop drives it.
#pragma once

#include <gmock/gmock.h>

#include <Eigen/Core>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "client/device/falcon/falcon_device.h"
#include "common/haptics/force_gate.h"
#include "tests/support/falcon_emulator/falcon_emulator.h"
#include "tests/support/patience.h"

namespace needlelab::test {

/// A gate with a tip at rest: the requested force comes out after the start ramp, as fast as the slew
/// limit allows.
class Pusher {
 public:
  GuardedWrench push(Vec3 force_W_N) noexcept;

 private:
  ForceGate gate_{DeviceLimits{}, 1000};
};

class FalconOnUsb : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  /// Plugs in the only Falcon, with its firmware running, and opens it.
  void openDevice(FalconOptions options = {});
  /// Runs ticks of 1 ms and skips late ones, until `tick` returns false. Returns false when that does not
  /// happen within kPatience.
  bool runTicks(const std::function<bool()>& tick);
  /// Reads in each tick with this force until `holds`. Returns false if it does not within kPatience.
  bool tickUntil(const std::function<bool()>& holds, Vec3 force_W_N = {});
  bool waitForFresh();
  /// Pulls the grip out and pushes it in until the encoders have found their zero and the device reads;
  /// leaves the grip in the middle.
  void home();

  UsbTestbed testbed_;
  FalconEmulator falcon_{testbed_};
  std::unique_ptr<FalconDevice> device_;
  DeviceReading reading_;
  DeviceRead last_read_ = DeviceRead::kNoUpdate;
  Pusher pusher_;
};

/// Moves out for the first half of `seconds`, in for the second half, then to the middle.
HandPath homingPath(double seconds);
/// Waits for an event from another thread. Returns false if it did not happen within kPatience.
bool waitUntil(const std::function<bool()>& done);
Bytes anyBytes(std::size_t count, unsigned seed);

}  // namespace needlelab::test
