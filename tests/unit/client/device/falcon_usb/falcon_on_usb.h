/// Our device `falcon` on the emulated USB; ticks drive it as the station's loop does.
#pragma once

#include <gmock/gmock.h>

#include <functional>
#include <memory>

#include "client/device/falcon/falcon_device.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/falcon_emulator/falcon_emulator.h"
#include "tests/support/patience.h"

namespace needlelab::test {

class FalconOnUsb : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  /// Without real-time priority.
  static FalconOptions options(const std::string& which = {});
  /// Plugs in the only Falcon, with its firmware running, and opens it.
  void openDevice(FalconOptions options = FalconOnUsb::options());
  /// Reads once per tick of 1 ms, with this force, until `holds`; skips late ticks. Returns false if it does
  /// not hold within kPatience. The force rises as fast as the gate's ramps allow.
  bool tickUntil(const std::function<bool()>& holds, Vec3 force_W_N = {});
  bool waitForFresh();
  /// The hand pulls the grip out and pushes it in until the encoders have found their zero.
  void moveOutAndIn();
  /// Repeats this until the device gives readings; leaves the grip in the middle.
  void home();

  UsbTestbed testbed_;
  FalconEmulator falcon_{testbed_};
  std::unique_ptr<FalconDevice> device_;
  DeviceReading reading_;
  DeviceRead last_read_ = DeviceRead::kNoUpdate;
  ForceGate gate_{DeviceLimits{}, 1000};
};

}  // namespace needlelab::test
