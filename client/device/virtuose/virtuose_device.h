/// A Haption Virtuose 6D Desktop through its vendor's library and service.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "client/device/device.h"
#include "client/device/turns.h"
#include "client/device/virtuose/virtuose_api.h"
#include "client/device/virtuose/virtuose_link.h"
#include "common/base/time/time_source.h"

namespace needlelab {

struct VirtuoseOptions {
  std::string address = kVirtuoseAddress;
  std::string library;      ///< empty: as loadVirtuoseApi()
  double timeout_s = 0.05;  ///< see VirtuoseSetup
  /// Wait between attempts to reconnect a lost device; doubles after each, up to the longest.
  std::chrono::milliseconds first_retry{500}, longest_retry{5000};
  /// Period of zero force while the device is open and no loop runs, because its watchdog cuts the link 2 s
  /// after the last command, and preparing a lesson may take longer.
  std::chrono::milliseconds keep_alive{500};
};

/// The atomic `owner_` names the thread that may use the connection. While a loop runs, that is the haptic
/// thread. When it detects a lost link, it passes the connection to `maintain`, does not touch it any more,
/// and takes over again when `maintain` has opened a new one. read and write take no lock; each makes at most
/// six library calls, none longer than the time-out.
///
/// Each tick queries position, speed, dead man and emergency stop; power, alarms, failures and buttons take
/// turns, so each is at most 6 ticks old.
class VirtuoseDevice final : public Device {
 public:
  /// `time` and `threads` must outlive the device.
  explicit VirtuoseDevice(VirtuoseOptions options = {}, TimeSource& time = machineTime(),
                          TurnRunner& threads = machineThreads());
  ~VirtuoseDevice() override { close(); }
  VirtuoseDevice(const VirtuoseDevice&) = delete;
  VirtuoseDevice& operator=(const VirtuoseDevice&) = delete;

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  /// Errors: as loadVirtuoseApi and openVirtuose. Succeeds even without power, with the emergency stop
  /// pressed or without a hand on the handle: `status` then gives advice.
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  void maintain() override;
  [[nodiscard]] std::string status() override;
  void close() noexcept override;

 private:
  enum class Owner : std::uint8_t {
    kClosed,
    kIdle,       ///< open, no loop: the next `read` takes the connection
    kKeepAlive,  ///< the keep-alive thread sends its zero force
    kLoop,       ///< the haptic thread's
    kLost,       ///< maintain's
  };
  static constexpr int kButtons = 3;  // numbered 1-3 by the vendor; bit 0 is number 1
  static constexpr int kTurns = 3 + kButtons;

  /// The keep-alive thread.
  struct KeepAlive final : Turns {
    explicit KeepAlive(VirtuoseDevice& kept) : device(kept) {}
    std::optional<std::int64_t> turn() noexcept override;
    void rest(std::int64_t until_ns) noexcept override { device.time_.sleepUntilNs(until_ns); }

    VirtuoseDevice& device;
    std::atomic<bool> stop{false};
    std::int64_t last_ns = 0;  // of the last zero force
  };

  Status connect();
  void keepAlive() noexcept;
  bool takeConnection() noexcept;
  bool succeeded(int result, const char* call) noexcept;
  bool pollNextState() noexcept;
  void giveUpConnection() noexcept;
  void countFailure() noexcept;
  [[nodiscard]] std::uint32_t rememberedCondition() const noexcept;

  VirtuoseOptions options_;
  TimeSource& time_;
  TurnRunner& threads_;
  DeviceInfo info_;
  std::optional<VirtuoseApi> api_;
  VirtuoseSetup setup_;

  // of the connection: used by the thread that owner_ names
  std::atomic<Owner> owner_{Owner::kClosed};
  VirtContext context_ = nullptr;
  std::array<bool, kButtons> has_button_{};
  std::uint32_t buttons_ = 0, alarm_ = 0, failure_ = 0;
  bool power_on_ = false;
  int turn_ = 0;
  bool link_is_lost_ = false;           // detected by the last failed call
  std::uint32_t trouble_ = 0;           // DeviceFlag bits of failed calls since the last reading
  std::uint64_t ticks_of_trouble_ = 0;  // in a row

  // set by the owner, for status()
  std::atomic<std::uint32_t> seen_condition_{0}, seen_alarm_{0}, seen_failure_{0};
  std::atomic<int> error_code_{0};
  std::atomic<const char*> error_call_{""};

  std::mutex mutex_;  // between open, close, maintain, status: never taken by read and write
  std::chrono::milliseconds retry_{0};
  std::int64_t next_try_ns_ = 0;
  std::string away_text_;  // of the last attempt
  KeepAlive keep_alive_{*this};
  std::unique_ptr<RunningTurns> keep_alive_thread_;
};

}  // namespace needlelab
