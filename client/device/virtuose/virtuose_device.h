/// A Haption Virtuose 6D Desktop through its vendor's library and service.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "client/device/device.h"
#include "client/device/virtuose/virtuose_api.h"
#include "client/device/virtuose/virtuose_link.h"

namespace needlelab {

struct VirtuoseOptions {
  std::string address = kVirtuoseAddress;
  std::string library;      ///< empty: as loadVirtuoseApi()
  double timeout_s = 0.05;  ///< see VirtuoseSetup
  /// Between two tries to find a lost device again; doubled after each up to the longest.
  std::chrono::milliseconds first_retry{500}, longest_retry{5000};
  /// Zero force is sent so often while the device is open and no loop runs: its watchdog cuts the link 2 s
  /// after the last command, and a lesson may take longer to prepare.
  std::chrono::milliseconds keep_alive{500};
};

/// One atomic, `owner_`, says which thread may use the connection: the haptic thread while a loop runs; when
/// it finds the link lost it hands the connection over to `maintain`, never touches it again, and takes it
/// back when `maintain` has opened a new one. No lock in read and write; each makes at most six calls of the
/// library, none of which takes longer than the time-out.
///
/// Each tick asks for position, speed, dead man and emergency stop; power, alarms, failures and buttons take
/// turns, so that each of them is at most 6 ticks old.
class VirtuoseDevice final : public Device {
 public:
  explicit VirtuoseDevice(VirtuoseOptions options = {});
  ~VirtuoseDevice() override { close(); }
  VirtuoseDevice(const VirtuoseDevice&) = delete;
  VirtuoseDevice& operator=(const VirtuoseDevice&) = delete;

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  /// Errors: as loadVirtuoseApi and openVirtuose. A device without power, with its emergency stop pressed or
  /// with nobody at its handle opens nevertheless: `status` says what to do.
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  void maintain() override;
  [[nodiscard]] std::string status() override;
  void close() noexcept override;

 private:
  enum class Owner : std::uint8_t {
    kClosed,
    kIdle,       ///< open, no loop: the next `read` takes it
    kKeepAlive,  ///< the keep-alive thread sends its zero force
    kLoop,       ///< the haptic thread's
    kLost,       ///< maintain's
  };
  static constexpr int kButtons = 3;  // numbered 1-3 by the vendor; bit 0 is number 1
  static constexpr int kTurns = 3 + kButtons;

  Status connect();
  void keepAlive();
  bool takeConnection() noexcept;
  bool succeeded(int result, const char* call) noexcept;
  bool askInTurn() noexcept;
  void giveUpConnection() noexcept;
  void countFailure() noexcept;
  [[nodiscard]] std::uint32_t rememberedCondition() const noexcept;

  VirtuoseOptions options_;
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
  bool link_is_lost_ = false;           // found by the last call that failed
  std::uint32_t trouble_ = 0;           // DeviceFlag bits of calls that failed since the last reading
  std::uint64_t ticks_of_trouble_ = 0;  // in a row

  // set by the owner, for status()
  std::atomic<std::uint32_t> seen_condition_{0}, seen_alarm_{0}, seen_failure_{0};
  std::atomic<int> error_code_{0};
  std::atomic<const char*> error_call_{""};

  std::mutex mutex_;  // between open, close, maintain, status: never taken by read and write
  std::chrono::milliseconds retry_{0};
  std::int64_t next_try_ns_ = 0;
  std::string away_text_;  // of the last try
  std::atomic<bool> stop_keep_alive_{false};
  std::thread keep_alive_thread_;
};

}  // namespace needlelab
