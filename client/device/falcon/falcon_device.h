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
  /// The maker's firmware; empty: the environment's NEEDLELAB_FALCON_FIRMWARE. Needed only by a Falcon that
  /// has lost its own, as each does when its power goes.
  std::string firmware_file;
  std::string which;  ///< serial number or bus path, e.g. "1-4.2"; empty: the only one
  int priority = 80;  ///< SCHED_FIFO of the USB thread, as the haptic thread's; without the right it is left
  /// Called with the progress of a firmware load, by the thread that loads. May be empty.
  std::function<void(const std::string&)> progress;
};

/// Parses the rest of `--device falcon…`: `[:FIRMWARE-FILE][@SERIAL-OR-BUS-PATH]`. An '@' before the last '/'
/// is part of the file's name. Errors (kInvalidInput): nothing after ':' or '@'.
Result<FalconOptions> falconOptions(const std::string& rest);

/// The Falcons of this computer, for `--list-devices`; without any, one entry that says so.
std::vector<FoundDevice> listFalcons();

/// The haptic thread reads the newest report and posts the newest torques through mailboxes, wait-free; a
/// thread of the device's own does the USB exchange, finds a lost device again, loads its firmware and
/// watches that the haptic thread lives (Exchange). The device finds its zero when it is pulled out and
/// pushed in once; until then `read` returns kNoUpdate with kDeviceNotReady; buttons count nevertheless, but
/// not while it is lost.
class FalconDevice final : public Device {
 public:
  explicit FalconDevice(FalconOptions options);
  FalconDevice(FalconOptions options, std::unique_ptr<falcon::FalconBus> bus);
  ~FalconDevice() override { close(); }
  FalconDevice(const FalconDevice&) = delete;
  FalconDevice& operator=(const FalconDevice&) = delete;

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  /// Loads the firmware when it must: some seconds. Errors: as FalconBus::open and FirmwareLoader; a rate
  /// above 1 kHz (kInvalidInput); a device that does not answer (kUnavailable). One that has not found its
  /// zero opens nevertheless: `status` says what the hand has to do.
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  [[nodiscard]] std::string status() override;
  /// Zero torque, answered by the device, before it is let go.
  void close() noexcept override;

  /// Counted by the kinematics in ticks since `open`: see KinematicFlag. Thread: any.
  [[nodiscard]] std::uint64_t clampedTicks() const noexcept { return clamped_ticks_.load(); }
  /// Counts of the link in use, updated twenty times a second. Thread: any but the haptic one.
  [[nodiscard]] falcon::ExchangeCounts counts();

 private:
  /// Places of the last reports, for the grip's speed.
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
  bool placed_ = false;  // legs_ is of a homed device
  std::uint32_t saturated_ = 0;
  std::uint32_t stale_ticks_ = 0;

  std::mutex mutex_;  // between the USB thread and status(): never taken by read and write
  std::string status_text_;
  falcon::ExchangeCounts counts_;
};

}  // namespace needlelab
