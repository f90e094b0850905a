/// A device that the test scripts, for the haptic loop on a FakeTime.
#pragma once

#include <algorithm>
#include <cmath>
#include <csignal>
#include <functional>
#include <limits>
#include <memory>
#include <utility>

#include "client/device/device.h"
#include "client/net/spool/spool_writer.h"
#include "client/station/run/loop/real_time.h"
#include "tests/support/time/fake_time.h"

namespace needlelab {

/// For loops that a test does not stop with a signal: the empty set.
inline sigset_t noSignals() {
  sigset_t none;
  sigemptyset(&none);
  return none;
}

}  // namespace needlelab

namespace needlelab::test {

/// Returns the result of `script` for the n-th tick of the device's own count, including skipped ticks.
class FakeDevice final : public Device {
 public:
  using Script = std::function<DeviceRead(std::uint64_t tick, DeviceReading& reading)>;
  explicit FakeDevice(Script script) : script_(std::move(script)) { writes.reserve(100'000); }
  [[nodiscard]] const DeviceInfo& info() const override { return device_info; }
  Status open(double) override { return {}; }
  DeviceRead read(DeviceReading& reading) noexcept override {
    ++reads;
    if (read_cost) read_cost();
    return tick < ends_at ? script_(tick++, reading) : DeviceRead::kFinished;
  }
  void write(const GuardedWrench& wrench) noexcept override {
    if (writes.size() < writes.capacity()) writes.push_back(wrench.wrench());
    if (on_write) on_write(tick);
  }
  std::uint64_t skip(std::uint64_t ticks) noexcept override {
    const std::uint64_t moved = std::min(ticks, ends_at - std::min(tick, ends_at));
    tick += moved;
    skipped += moved;
    return moved;
  }
  void close() noexcept override {}

  DeviceInfo device_info{"fake", {}, true, true, true};
  std::uint64_t tick = 0, reads = 0, skipped = 0;
  std::uint64_t ends_at = std::numeric_limits<std::uint64_t>::max();  ///< first tick after the motion
  std::vector<Wrench> writes;
  std::function<void(std::uint64_t)> on_write;
  std::function<void()> read_cost;  ///< advances the test's clock

 private:
  Script script_;
};

/// The tip moves straight down at `speed_mps` from 1 mm above z = 0, with the needle axis downward.
inline FakeDevice::Script goingDown(double speed_mps, double rate_hz) {
  return [speed_mps, rate_hz](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH.p = {0, 0, 1e-3 - speed_mps * static_cast<double>(tick) / rate_hz};
    reading.X_WH.q = {1, 0, 0, 0};  // half a turn about x: +z of the tool points down
    return DeviceRead::kFresh;
  };
}

}  // namespace needlelab::test
