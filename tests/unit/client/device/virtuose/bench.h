/// A Virtuose on the stand-in, for tests: virtual time, one call per tick.
#pragma once

#include <gmock/gmock.h>

#include <string>
#include <utility>
#include <vector>

#include "client/device/haptic_chain.h"
#include "client/device/virtuose/virtuose_device.h"
#include "client/device/virtuose/virtuose_errors.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/time/device_world.h"
#include "tests/support/virtuose_standin/control.h"

namespace needlelab::test {

inline constexpr double kTick_s = 0.001;

inline VirtuoseApi standinApi() {
  auto api = loadVirtuoseApi(kStandinLibrary);
  if (!api.ok()) throw std::runtime_error(api.error().message);
  return *api;
}

inline VirtuoseOptions standinOptions() {
  VirtuoseOptions options;
  options.library = kStandinLibrary;
  options.first_retry = options.longest_retry = std::chrono::milliseconds(0);  // each maintain() tries
  return options;
}

/// An open device whose readings go through a gate.
class VirtuoseTest : public testing::Test {
 protected:
  void open(double rate_hz = 1000) {
    const Status status = device_.open(rate_hz);
    ASSERT_TRUE(status.ok()) << status.error().message;
  }
  /// One tick: a millisecond passes, the device is read, and `wanted` is written through the gate.
  DeviceRead tick(const Wrench& wanted = {}) {
    standin_.advance(kTick_s);
    const DeviceRead read = device_.read(reading_);
    const bool is_admitted = gate_.admit({reading_.X_WH.p, reading_.X_WH.q}, read == DeviceRead::kFresh,
                                         reading_.speed_mps, 1, reading_.condition);
    device_.write(gate_.guard(is_admitted ? wanted : Wrench{}));
    return read;
  }
  void ticks(int count, const Wrench& wanted = {}) {
    for (int k = 0; k < count; ++k) tick(wanted);
  }
  /// Runs enough ticks for the device to make every kind of query.
  void askAll() { ticks(7); }

  Standin standin_;
  DeviceWorld world_;  // its time stands still unless a test sleeps
  VirtuoseDevice device_{standinOptions(), world_, world_};
  ForceGate gate_{DeviceLimits{}, 1000};
  DeviceReading reading_;
};

}  // namespace needlelab::test
