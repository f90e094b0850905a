/// The work of the Falcon's USB thread, pass by pass: opens the device, loads its firmware, exchanges
/// packets, looks for a lost device, sends the last command.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "client/device/falcon/falcon_exchange.h"
#include "client/device/falcon/falcon_link.h"
#include "client/device/turns.h"
#include "common/base/result.h"
#include "common/base/time/time_source.h"

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

namespace falcon {

/// Thread: `open` by the owner while no turns are called; `turn` and `rest` by the USB thread; the haptic
/// thread uses `boxes`; the rest by any thread but the haptic one.
class FalconDriver final : public Turns {
 public:
  static constexpr std::int64_t kFinalCommand_ns = 100'000'000;  ///< patience for the last command's answer
  static constexpr std::int64_t kBreath_ns = 20'000'000;         ///< after a loss, before the first look
  static constexpr std::int64_t kRescan_ns = 500'000'000;  ///< between two looks; an arrival shortens it

  /// `time` must outlive the driver.
  FalconDriver(FalconOptions options, std::unique_ptr<FalconBus> bus, TimeSource& time);

  /// Opens the device and loads its firmware if needed, which takes some seconds. The next turn begins the
  /// exchange. Errors: as FalconBus::open and FirmwareLoader.
  Status open();
  /// Asks for the end: sends the last command, then takes no more turns.
  void stop() noexcept { stop_ = true; }

  std::optional<std::int64_t> turn() noexcept override;
  void rest(std::int64_t until_ns) noexcept override;

  [[nodiscard]] Mailboxes& boxes() noexcept { return boxes_; }
  /// Whether the device has reported since `open`.
  [[nodiscard]] bool answered() const noexcept { return answered_; }
  /// Returns the current link's counts, updated twenty times a second.
  [[nodiscard]] ExchangeCounts counts();
  [[nodiscard]] std::string statusText();
  void setStatusText(std::string text);

 private:
  Result<std::unique_ptr<FalconLink>> connect();
  Status loadFirmware(FalconLink& link);
  std::optional<std::int64_t> beginStream() noexcept;
  std::optional<std::int64_t> stream(std::int64_t now_ns) noexcept;
  std::optional<std::int64_t> endStream() noexcept;
  std::optional<std::int64_t> look() noexcept;
  void updateStatusText();

  FalconOptions options_;
  std::unique_ptr<FalconBus> bus_;
  TimeSource& time_;
  Mailboxes boxes_;
  std::atomic<bool> stop_{false}, answered_{false};

  // the USB thread's
  std::unique_ptr<FalconLink> link_;
  std::optional<Exchange> exchange_;  // of the stream; none: the device is away or has just been opened
  bool closing_ = false;              // the last command is being sent
  std::int64_t tell_ns_ = 0;

  std::mutex mutex_;  // between the USB thread and statusText(): never taken by the haptic thread
  std::string status_text_;
  ExchangeCounts counts_;
};

}  // namespace falcon
}  // namespace needlelab
