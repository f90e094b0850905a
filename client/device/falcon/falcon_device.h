/// A Novint Falcon on USB: three axes of force, no torque, no orientation, four buttons.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "client/device/device.h"
#include "client/device/falcon/falcon_exchange.h"
#include "client/device/falcon/falcon_kinematics.h"
#include "client/device/falcon/falcon_link.h"

namespace needlelab {

struct FalconOptions {
  /// The maker's firmware; empty: the environment's NEEDLELAB_FALCON_FIRMWARE. Needed only after a power
  /// cycle, because a Falcon then loses its firmware.
  std::string firmware_file;
  std::string which;  ///< serial number or bus path, e.g. "1-4.2"; empty: the only one
  int priority = 80;  ///< SCHED_FIFO of the USB thread, as the haptic thread's; ignored without permission
  /// Called with the progress of a firmware load, on the loading thread. May be empty.
  std::function<void(const std::string&)> progress;
};

/// Parses the rest of `--device falcon…`: `[:FIRMWARE-FILE][@SERIAL-OR-BUS-PATH]`. An '@' before the last '/'
/// is part of the file's name. Errors (kInvalidInput): nothing after ':' or '@'.
Result<FalconOptions> falconOptions(const std::string& rest);

/// Lists this computer's Falcons for `--list-devices`; without any, returns one entry that says so.
std::vector<FoundDevice> listFalcons();

/// The haptic thread reads the newest report and posts the newest torques through wait-free mailboxes. The
/// device's own thread does the USB exchange, reconnects a lost device, loads its firmware and monitors the
/// haptic thread (Exchange). The device finds its zero when the grip is pulled out and pushed in once; until
/// then `read` returns kNoUpdate with kDeviceNotReady. Buttons work before that, but not while the device is
/// lost.
class FalconDevice final : public Device {
 public:
  explicit FalconDevice(FalconOptions options);
  FalconDevice(FalconOptions options, std::unique_ptr<falcon::FalconBus> bus);
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
  [[nodiscard]] std::string status() override;
  /// Sends zero torque, waits for the device's answer, then releases the device.
  void close() noexcept override;

  /// Returns the number of ticks since `open` with a KinematicFlag. Thread: any.
  [[nodiscard]] std::uint64_t clampedTicks() const noexcept { return clamped_ticks_.load(); }
  /// Returns the current link's counts, updated twenty times a second. Thread: any but the haptic one.
  [[nodiscard]] falcon::ExchangeCounts counts();

 private:
  /// Positions from the last reports, for the grip's speed.
  struct Trail {
    static constexpr std::size_t kSteps = 8;
    std::array<Vec3, kSteps> p_m{};
    std::array<std::int64_t, kSteps> at_ns{};
    std::size_t used = 0, next = 0;
  };

  Result<std::unique_ptr<falcon::FalconLink>> connect();
  Status loadFirmware(falcon::FalconLink& link);
  void run(std::unique_ptr<falcon::FalconLink> link) noexcept;
  void runStream(falcon::FalconLink& link) noexcept;
  void setStatusText(std::string text);
  void updateStatusText(const falcon::Exchange& exchange);
  [[nodiscard]] double speed(Vec3 p_m, std::int64_t at_ns) noexcept;

  FalconOptions options_;
  DeviceInfo info_;
  std::unique_ptr<falcon::FalconBus> bus_;
  falcon::Mailboxes boxes_;
  std::thread thread_;
  std::atomic<bool> stop_{false}, answered_{false};
  std::atomic<std::uint64_t> clamped_ticks_{0};

  // the haptic thread's
  falcon::LegJacobian legs_;
  Trail trail_;
  bool placed_ = false;  // legs_ is from a homed device
  std::uint32_t saturated_ = 0;
  std::uint32_t stale_ticks_ = 0;

  std::mutex mutex_;  // between the USB thread and status(): never taken by read and write
  std::string status_text_;
  falcon::ExchangeCounts counts_;
};

}  // namespace needlelab
