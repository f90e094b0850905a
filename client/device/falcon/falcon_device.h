/// A Novint Falcon on USB: three axes of force, no torque, no orientation, four buttons.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/falcon/falcon_driver.h"
#include "client/device/falcon/falcon_kinematics.h"
#include "client/device/falcon/falcon_link.h"
#include "client/device/turns.h"
#include "common/base/time/time_source.h"

namespace needlelab {

/// Parses the rest of `--device falcon…`: `[:FIRMWARE-FILE][@SERIAL-OR-BUS-PATH]`. An '@' before the last '/'
/// is part of the file's name. Errors (kInvalidInput): nothing after ':' or '@'.
Result<FalconOptions> falconOptions(const std::string& rest);

/// Lists this computer's Falcons for `--list-devices`; without any, returns one entry that says so.
std::vector<FoundDevice> listFalcons();

/// The haptic thread reads the newest report and posts the newest torques through wait-free mailboxes. The
/// device's own thread does the USB exchange, reconnects a lost device, loads its firmware and monitors the
/// haptic thread (FalconDriver, Exchange). The device finds its zero when the grip is pulled out and pushed
/// in once; until then `read` returns kNoUpdate with kDeviceNotReady. Buttons work before that, but not while
/// the device is lost.
class FalconDevice final : public Device {
 public:
  explicit FalconDevice(FalconOptions options);
  /// `time` and `threads` must outlive the device.
  FalconDevice(FalconOptions options, std::unique_ptr<falcon::FalconBus> bus,
               TimeSource& time = machineTime(), TurnRunner& threads = machineThreads());
  ~FalconDevice() override { close(); }
  FalconDevice(const FalconDevice&) = delete;
  FalconDevice& operator=(const FalconDevice&) = delete;

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  /// Loads the firmware if needed, which takes some seconds. Errors: as FalconBus::open and FirmwareLoader; a
  /// rate above 1 kHz (kInvalidInput); a device that does not answer (kUnavailable). Succeeds before the
  /// device has found its zero: `status` then says how to move the grip.
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  [[nodiscard]] std::string status() override { return driver_.statusText(); }
  /// Sends zero torque, waits for the device's answer, then releases the device.
  void close() noexcept override;

  /// Returns the number of ticks since `open` with a KinematicFlag. Thread: any.
  [[nodiscard]] std::uint64_t clampedTicks() const noexcept { return clamped_ticks_.load(); }
  /// Returns the current link's counts, updated twenty times a second. Thread: any but the haptic one.
  [[nodiscard]] falcon::ExchangeCounts counts() { return driver_.counts(); }

 private:
  /// Positions from the last reports, for the grip's speed.
  struct Trail {
    static constexpr std::size_t kSteps = 8;
    std::array<Vec3, kSteps> p_m{};
    std::array<std::int64_t, kSteps> at_ns{};
    std::size_t used = 0, next = 0;
  };

  [[nodiscard]] double speed(Vec3 p_m, std::int64_t at_ns) noexcept;

  int priority_;
  TimeSource& time_;
  TurnRunner& threads_;
  DeviceInfo info_;
  falcon::FalconDriver driver_;
  std::unique_ptr<RunningTurns> running_;
  std::atomic<std::uint64_t> clamped_ticks_{0};

  // the haptic thread's
  falcon::LegJacobian legs_;
  Trail trail_;
  bool placed_ = false;  // legs_ is from a homed device
  std::uint32_t saturated_ = 0;
  std::uint32_t stale_ticks_ = 0;
};

}  // namespace needlelab
