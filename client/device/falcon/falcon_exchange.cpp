#include "client/device/falcon/falcon_exchange.h"

#include <algorithm>

#include "client/device/falcon/falcon_geometry.h"
#include "common/base/planted_bug.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab::falcon {

Exchange::Exchange(FalconLink& link, Mailboxes& boxes, std::int64_t now_ns)
    : link_(link),
      boxes_(boxes),
      due_ns_(now_ns),
      sent_ns_(now_ns),
      last_report_ns_(now_ns),
      last_request_ns_(now_ns - kWatchdog_ns - 1) {
  // requests from before this link are dropped
  MotorRequest old;
  if (!planted(PlantedBug::kRequestOutlivesLink)) static_cast<void>(boxes_.requests.fetch(old));
}

void Exchange::onRead(std::span<const std::uint8_t> raw, std::int64_t now_ns) noexcept {
  TimedReport seen;
  bool fresh = false;
  eachPayloadByte(raw, [&](std::uint8_t byte) {
    if (!reader_.push(byte, seen.report)) return;
    fresh = true;
    ++counts_.reports;
    if (unanswered_ > 0) --unanswered_;
  });
  counts_.bad_packets = reader_.bad();
  if (!fresh) return;
  seen.at_ns = last_report_ns_ = now_ns;
  homed_ = (seen.report.bits & kInHomed) == kInHomed;
  boxes_.reports.publish(seen);
}

void Exchange::onSent(bool done) noexcept {
  sending_ = false;
  // an unsent command gets no answer
  if (!done && unanswered_ > 0) --unanswered_;
}

void Exchange::judge(std::int64_t now_ns) noexcept {
  if (reader_.badInARow() >= kMaxBadInARow)
    trouble_ = Trouble::kBadPackets;
  else if (now_ns - last_report_ns_ > kSilent_ns)
    trouble_ = Trouble::kSilent;
  else
    trouble_ = Trouble::kNone;
  std::uint32_t condition = 0;
  if (trouble_ != Trouble::kNone) condition |= kDeviceTrouble;
  if (!homed_) condition |= kDeviceNotReady;
  boxes_.condition.store(condition, std::memory_order_release);
}

Command Exchange::nextCommand(std::int64_t now_ns) noexcept {
  if (boxes_.requests.fetch(request_)) {
    last_request_ns_ = now_ns;
    starved_ = false;
  } else if (now_ns - last_request_ns_ >
             (planted(PlantedBug::kDeviceWatchdogTwice) ? 2 * kWatchdog_ns : kWatchdog_ns)) {
    if (!starved_) ++counts_.starved_times;
    starved_ = true;
  }
  Command command;
  const bool may_drive = homed_ || planted(PlantedBug::kTorqueWithoutZero);
  if (may_drive && !starved_ && trouble_ == Trouble::kNone) command.motor = request_.motor;
  // red while the device needs the user, green when it is ready
  command.bits = homed_ ? kOutGreen : kOutRed | kOutHome;
  return command;
}

std::int64_t Exchange::step(std::int64_t now_ns) noexcept {
  if (final_) return stepFinal(now_ns);
  judge(now_ns);
  if (unanswered_ > 0 && now_ns - sent_ns_ > kReplyTime_ns) {
    counts_.unanswered += static_cast<std::uint64_t>(unanswered_);
    unanswered_ = 0;
  }
  if (sending_ || unanswered_ >= kMaxUnderWay)
    return std::max(sent_ns_ + kReplyTime_ns + 1, now_ns + kPeriod_ns);
  if (now_ns < due_ns_) return due_ns_;

  // the period keeps its phase unless a whole one was missed
  due_ns_ += kPeriod_ns;
  if (due_ns_ <= now_ns) due_ns_ = now_ns + kPeriod_ns;
  const Packet packet = encodeCommand(nextCommand(now_ns));
  if (link_.send(packet)) {
    ++counts_.sent;
    ++unanswered_;
    sending_ = true;
    sent_ns_ = now_ns;
  }
  return due_ns_;
}

void Exchange::startFinalCommand(std::int64_t now_ns, std::int64_t patience_ns) noexcept {
  final_ = true;
  final_sent_ = false;
  final_end_ns_ = now_ns + patience_ns;
  final_again_ns_ = now_ns;
}

bool Exchange::finalCommandAnswered() const noexcept {
  return final_sent_ && !sending_ && counts_.reports > reports_before_final_;
}

bool Exchange::finalCommandOver(std::int64_t now_ns) const noexcept {
  return link_.lost() || now_ns >= final_end_ns_ || finalCommandAnswered();
}

std::int64_t Exchange::stepFinal(std::int64_t now_ns) noexcept {
  // the write in progress comes first: it may still carry torque
  if (!sending_ && now_ns >= final_again_ns_ && link_.send(encodeCommand({}))) {
    // answers to earlier commands do not count
    if (!final_sent_) reports_before_final_ = counts_.reports + static_cast<std::uint64_t>(unanswered_);
    final_sent_ = sending_ = true;
    final_again_ns_ = now_ns + kReplyTime_ns;
  }
  return std::min(final_end_ns_, std::max(final_again_ns_, now_ns + kPeriod_ns));
}

}  // namespace needlelab::falcon
