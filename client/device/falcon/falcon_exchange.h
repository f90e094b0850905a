/// The exchange with a Falcon that runs its firmware: one command, one report, a thousand times a second. Up
/// to two commands may be in flight: the USB chip holds a reply back for up to 1 ms, and waiting for it would
/// lengthen the period.
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
  std::int64_t at_ns = 0;  ///< of the link's time
};

/// From the haptic thread to the USB thread.
struct MotorRequest {
  std::array<std::int16_t, 3> motor{};
};

/// The two threads' shared data: wait-free both ways.
struct Mailboxes {
  LatestValue<TimedReport> reports;
  LatestValue<MotorRequest> requests;
  std::atomic<std::uint32_t> condition{0};  ///< DeviceFlag bits, by the USB thread
};

/// Counts since the link was opened.
struct ExchangeCounts {
  std::uint64_t sent = 0, reports = 0;
  std::uint64_t bad_packets = 0;
  std::uint64_t unanswered = 0;     ///< commands without a report in time
  std::uint64_t starved_times = 0;  ///< how often the haptic thread fell silent and zero torque was sent
};

/// Drives the motors only while the device has found its zero, reports are good, and the haptic thread has
/// posted a request within the last 20 ms. The caller passes the time. Thread: the USB thread.
class Exchange final : public LinkListener {
 public:
  static constexpr std::int64_t kPeriod_ns = 1'000'000;
  static constexpr std::int64_t kWatchdog_ns = 20'000'000;  ///< silence of the haptic thread
  static constexpr int kMaxUnderWay = 2;
  static constexpr std::int64_t kReplyTime_ns = 6'000'000;   ///< longest wait for a reply
  static constexpr std::int64_t kSilent_ns = 100'000'000;    ///< then it is kDeviceTrouble
  static constexpr std::int64_t kGiveUp_ns = 1'000'000'000;  ///< after this the link is opened again
  static constexpr std::uint32_t kMaxBadInARow = 20;         ///< then it is kDeviceTrouble

  enum class Trouble : std::uint8_t { kNone, kBadPackets, kSilent };

  Exchange(FalconLink& link, Mailboxes& boxes, std::int64_t now_ns);

  /// Sends when due. Returns the time of the next call; an earlier call does no harm.
  std::int64_t step(std::int64_t now_ns) noexcept;
  /// From now on `step` sends only the last command, zero torque with the lights off, and again every 6 ms
  /// until its answer or for `patience_ns`.
  void startFinalCommand(std::int64_t now_ns, std::int64_t patience_ns) noexcept;
  /// Whether the last command was answered or timed out, or the device is lost: no more steps.
  [[nodiscard]] bool finalCommandOver(std::int64_t now_ns) const noexcept;
  /// The device has answered the last command.
  [[nodiscard]] bool finalCommandAnswered() const noexcept;

  void onRead(std::span<const std::uint8_t> raw, std::int64_t now_ns) noexcept override;
  void onSent(bool done) noexcept override;

  [[nodiscard]] bool homed() const noexcept { return homed_; }
  [[nodiscard]] Trouble trouble() const noexcept { return trouble_; }
  [[nodiscard]] bool timedOut(std::int64_t now_ns) const noexcept {
    return now_ns - last_report_ns_ > kGiveUp_ns;
  }
  [[nodiscard]] const ExchangeCounts& counts() const noexcept { return counts_; }

 private:
  [[nodiscard]] Command nextCommand(std::int64_t now_ns) noexcept;
  void judge(std::int64_t now_ns) noexcept;
  std::int64_t stepFinal(std::int64_t now_ns) noexcept;

  FalconLink& link_;
  Mailboxes& boxes_;
  PacketReader reader_;
  ExchangeCounts counts_;
  MotorRequest request_;
  std::int64_t due_ns_, sent_ns_, last_report_ns_, last_request_ns_;
  bool sending_ = false;
  int unanswered_ = 0;  // commands in flight
  bool homed_ = false, starved_ = true;
  // the last command
  bool final_ = false, final_sent_ = false;
  std::int64_t final_end_ns_ = 0, final_again_ns_ = 0;
  std::uint64_t reports_before_final_ = 0;
  Trouble trouble_ = Trouble::kNone;
};

}  // namespace needlelab::falcon
