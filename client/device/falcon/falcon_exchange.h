/// The conversation with a Falcon whose firmware runs: one command, one report, a thousand times a second.
/// Up to two commands may be under way: the USB chip holds a reply back for up to 1 ms, and to wait for it
/// would make the period longer than that.
#pragma once

#include <atomic>
#include <cstdint>

#include "client/device/falcon/falcon_link.h"
#include "client/device/falcon/falcon_packet.h"
#include "common/base/wait_free.h"

namespace needlelab::falcon {

/// From the USB thread to the haptic thread.
struct TimedReport {
  Report report;
  std::int64_t at_ns = 0;  ///< steadyNowNs
};

/// From the haptic thread to the USB thread.
struct MotorWish {
  std::array<std::int16_t, 3> motor{};
};

/// What the two threads share: wait-free both ways.
struct Mailboxes {
  LatestValue<TimedReport> reports;
  LatestValue<MotorWish> wishes;
  std::atomic<std::uint32_t> condition{0};  ///< DeviceFlag bits, by the USB thread
};

/// Counted since the link was opened.
struct ExchangeCounts {
  std::uint64_t sent = 0, reports = 0;
  std::uint64_t bad_packets = 0;
  std::uint64_t unanswered = 0;     ///< commands that no report followed in time
  std::uint64_t starved_times = 0;  ///< the haptic thread fell silent: zero torque was sent
};

/// Motors turn only while the device has found its zero, reports are good, and the haptic thread has asked
/// for it within the last 20 ms. Time is handed in, so that tests have their own. Thread: the USB thread.
class Exchange final : public LinkListener {
 public:
  static constexpr std::int64_t kPeriod_ns = 1'000'000;
  static constexpr std::int64_t kWatchdog_ns = 20'000'000;  ///< silence of the haptic thread
  static constexpr int kMostUnderWay = 2;
  static constexpr std::int64_t kReplyTime_ns = 6'000'000;   ///< then no reply is waited for any more
  static constexpr std::int64_t kSilent_ns = 100'000'000;    ///< then it is kDeviceTrouble
  static constexpr std::int64_t kGiveUp_ns = 1'000'000'000;  ///< then the link is opened anew
  static constexpr std::uint32_t kMostBadInARow = 20;        ///< then it is kDeviceTrouble

  enum class Trouble : std::uint8_t { kNone, kBadPackets, kSilent };

  Exchange(FalconLink& link, Mailboxes& boxes, std::int64_t now_ns);

  /// Sends if it is time. Returns when it wants to be called again; sooner does no harm.
  std::int64_t turn(std::int64_t now_ns) noexcept;
  /// Says the last word: lights out, zero torque, answered. Waits for it at most `patience_ns`; false when
  /// nobody answered.
  bool sayGoodbye(std::int64_t patience_ns) noexcept;

  void onRead(std::span<const std::uint8_t> raw, std::int64_t now_ns) noexcept override;
  void onSent(bool done) noexcept override;

  [[nodiscard]] bool homed() const noexcept { return homed_; }
  [[nodiscard]] Trouble trouble() const noexcept { return trouble_; }
  [[nodiscard]] bool hopeless(std::int64_t now_ns) const noexcept {
    return now_ns - last_report_ns_ > kGiveUp_ns;
  }
  [[nodiscard]] const ExchangeCounts& counts() const noexcept { return counts_; }

 private:
  [[nodiscard]] Command nextCommand(std::int64_t now_ns) noexcept;
  void judge(std::int64_t now_ns) noexcept;

  FalconLink& link_;
  Mailboxes& boxes_;
  PacketReader reader_;
  ExchangeCounts counts_;
  MotorWish wish_;
  std::int64_t due_ns_, sent_ns_, last_report_ns_, last_wish_ns_;
  bool sending_ = false;
  int unanswered_ = 0;  // commands under way
  bool homed_ = false, starved_ = true;
  Trouble trouble_ = Trouble::kNone;
};

}  // namespace needlelab::falcon
