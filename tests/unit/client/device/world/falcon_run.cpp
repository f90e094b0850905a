#include "tests/unit/client/device/world/falcon_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "client/device/falcon/falcon_geometry.h"

namespace needlelab::test {
namespace {

using falcon::Exchange;
using falcon::FalconDriver;

constexpr const char* kTroubleNames[kTroubles] = {
    "haptic thread hangs", "USB thread hangs", "unplugged", "power cut", "board silent", "garbled", "lossy",
    "zero lost",           "grip jumps"};
constexpr Vec3 kOutside_m{0, 0, 0.008};
constexpr std::size_t kFirmwareBytes = 100;
constexpr std::int64_t kRecovery_ns = 3'000 * kMs;

bool anyTorque(const falcon::Command& command) {
  return command.motor != Motors{};
}

}  // namespace

FalconPlan falconPlanOf(std::uint64_t seed) {
  Random random(seed);
  FalconPlan plan;
  plan.seed = seed;
  const bool is_calm = random.chance(0.2);
  plan.tick_late_ns = is_calm ? 0 : random.upTo(random.chance(0.2) ? 3 * kMs : kMs / 2);
  plan.usb_late_ns = is_calm ? 0 : random.upTo(random.chance(0.2) ? 3 * kMs : kMs / 2);
  plan.write_ns = random.upTo(kMs / 5);
  plan.reply_ns = random.upTo(kMs);
  plan.reply_spread_ns = random.upTo(kMs);
  plan.lost_share = random.chance(0.3) ? random.in(0, 0.05) : 0;
  plan.usb_phase_ns = random.upTo(kMs);
  plan.lasts_ns = 150 * kMs + random.upTo(450 * kMs);
  plan.acknowledged_every_ns = random.chance(0.7) ? 20 * kMs + random.upTo(100 * kMs) : 0;
  plan.stroke_s = random.in(0.3, 1.2);
  plan.six_layers = random.chance(0.5);
  plan.haptic_dies_first = random.chance(0.3);
  for (std::uint64_t left = random.below(6); left > 0; --left) {
    PlannedTrouble trouble{static_cast<Trouble>(random.below(kTroubles)), random.upTo(plan.lasts_ns), 0};
    switch (trouble.what) {
      case Trouble::kHapticHangs:
        trouble.lasts_ns = random.upTo(random.chance(0.5) ? 60 * kMs : 500 * kMs);
        break;
      case Trouble::kUsbHangs:
        trouble.lasts_ns = random.upTo(40 * kMs);
        break;
      case Trouble::kGripJumps:
        trouble.lasts_ns = random.upTo(12 * kMs);
        break;
      case Trouble::kUnplugged:
      case Trouble::kPowerCut:
      case Trouble::kBoardSilent:
        trouble.lasts_ns = random.upTo(random.chance(0.3) ? 1'500 * kMs : 200 * kMs);
        if (random.chance(0.3)) trouble.haptic_hangs_ns = random.upTo(400 * kMs);
        break;
      default:
        trouble.lasts_ns = random.upTo(150 * kMs);
    }
    plan.lasts_ns =
        std::max(plan.lasts_ns, trouble.at_ns + std::max(trouble.lasts_ns, trouble.haptic_hangs_ns));
    plan.troubles.push_back(trouble);
  }
  return plan;
}

std::string textOf(const FalconPlan& plan) {
  const auto ms = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-6; };
  std::string text = fmt::format(
      "{:.0f} ms, ticks late by up to {:.2f} ms, USB thread by {:.2f} ms, answers after {:.2f} to {:.2f} ms, "
      "{:.1f} % lost",
      ms(plan.lasts_ns), ms(plan.tick_late_ns), ms(plan.usb_late_ns), ms(plan.reply_ns),
      ms(plan.reply_ns + plan.reply_spread_ns), 100 * plan.lost_share);
  for (const PlannedTrouble& trouble : plan.troubles)
    text += fmt::format("; at {:.1f} ms for {:.1f} ms: {}", ms(trouble.at_ns), ms(trouble.lasts_ns),
                        kTroubleNames[static_cast<std::size_t>(trouble.what)]);
  return text;
}

FalconRun::FalconRun(const FalconPlan& plan, double gate_rate_hz)
    : WorldRun(plan, gate_rate_hz), plan_(plan) {
  hand.p_m = kOutside_m;
  hand.at_ns = world.nowNs();
  stroke(0);
  falcon->encoder = hand.encoders();
  falcon->keeps_commands = false;
  falcon->write_ns = plan.write_ns;
  falcon->fate = [this] { return fateOfPacket(); };
  falcon->on_stream = [this] { onStream(); };
  falcon->on_send = [this](const falcon::Command& command, std::int64_t now_ns) { onSend(command, now_ns); };
  falcon->on_command = [this](const falcon::Command& command, std::int64_t now_ns) {
    onCommand(command, now_ns);
  };
  falcon->on_reply = [this](const std::optional<falcon::Report>& report, std::int64_t now_ns) {
    onReply(report, now_ns);
  };

  world.listen("falcon-usb", [this] { return falcon->nextEventNs(); });
  world.wakeLate("falcon-usb", [this] {
    const std::int64_t late_ns = random_.upTo(plan_.usb_late_ns) + std::exchange(usb_hangs_ns_, 0);
    greatest_usb_late_ns_ = std::max(greatest_usb_late_ns_, late_ns);
    return late_ns;
  });

  FalconOptions options;
  options.firmware_file = folder_.write("fw.bin", std::string(kFirmwareBytes, 'f')).string();
  device = std::make_unique<FalconDevice>(options, DirectFalcon::bus(falcon, world), world, world);
  useDevice(*device, [this] { onTick(); });
}

FalconRun::~FalconRun() {
  end();
}

void FalconRun::begin() {
  if (const Status done = device->open(1000); !done.ok()) throw std::runtime_error(done.error().message);
  world.sleepForNs(plan_.usb_phase_ns);
  keeper_ = std::make_unique<DeviceMaintenance>(*device, world, world);
  haptic_thread_ = world.start(*haptic, {"haptic", 0});
}

void FalconRun::play() {
  begin();
  stroke(plan_.stroke_s);
  const std::int64_t start_ns = world.nowNs();
  for (const PlannedTrouble& planned : plan_.troubles)
    world.at(start_ns + planned.at_ns, [this, planned] { trouble(planned); });
  acknowledgeAsPlanned(plan_);
  world.sleepUntilNs(start_ns + plan_.lasts_ns);
  // the troubles are over and the hand is outside: the device recovers in time
  stroke(0);
  plan_.lost_share = 0;
  recoverWithin(kRecovery_ns, [this] { return (haptic->reading().condition & ~kDeviceOverrun) == 0; });
  end();
}

void FalconRun::end() {
  if (haptic_thread_ == nullptr) return;
  const auto endHaptics = [&] {
    haptic->stop();
    haptic_thread_.reset();
  };
  if (plan_.haptic_dies_first)
    haptic->hangUntil(world.nowNs() + 300 * kMs);
  else
    endHaptics();
  keeper_.reset();
  const bool is_connected = falcon->plugged && falcon->streams != nullptr;
  closing_ = true;
  device->close();
  closed_ns = world.nowNs();
  if (is_connected && sent_at_the_end_ == 0) breakRule("no last command");
  if (haptic_thread_ != nullptr) endHaptics();
  const std::uint64_t sent_before = sent_at_the_end_;
  world.sleepForNs(50 * kMs);
  if (sent_at_the_end_ != sent_before) breakRule("a command after the end");
  if (falcon->open_links != 0) breakRule("a link is left open");
  if (falcon->refused != 0) breakRule("a command while another one is written");
  checkLooks();
}

void FalconRun::plugIn() {
  falcon->plugIn();
  arrivals_ns_.push_back(world.nowNs());
}

void FalconRun::stroke(double stroke_s, double deepest_m) {
  hand.follow([=](double t_s) {
    if (stroke_s <= 0) return kOutside_m;
    const double turns = t_s / stroke_s;
    const double share = std::fabs(2 * (turns - std::floor(turns)) - 1);
    return Vec3{0, 0, -deepest_m + share * (kOutside_m.z + deepest_m)};
  });
}

Fate FalconRun::fateOfPacket() {
  Fate fate;
  const double lost = is_lossy_ ? 0.5 : plan_.lost_share;
  fate.arrives = !random_.chance(lost);
  fate.is_answered = !random_.chance(lost);
  fate.is_garbled = is_garbled_;
  fate.reply_ns = plan_.reply_ns + random_.upTo(plan_.reply_spread_ns);
  return fate;
}

void FalconRun::trouble(const PlannedTrouble& planned) {
  const std::int64_t until_ns = world.nowNs() + planned.lasts_ns;
  const auto afterwards = [&](std::function<void()> happens) { world.at(until_ns, std::move(happens)); };
  if (planned.haptic_hangs_ns > 0) haptic->hangUntil(world.nowNs() + planned.haptic_hangs_ns);
  switch (planned.what) {
    case Trouble::kHapticHangs:
      haptic->hangUntil(until_ns);
      break;
    case Trouble::kUsbHangs:
      usb_hangs_ns_ = planned.lasts_ns;
      break;
    case Trouble::kUnplugged:
    case Trouble::kPowerCut:
      falcon->unplug();
      if (planned.what == Trouble::kPowerCut) {
        falcon->forgetFirmware();
        falcon->homed = 0;
        hand.motors = {};
        // the hand finds the zero again
        world.at(until_ns + 300 * kMs, [this] { falcon->homed = falcon::kInHomed; });
      }
      afterwards([this] { plugIn(); });
      break;
    case Trouble::kBoardSilent:
      falcon->silent = true;
      afterwards([this] { falcon->silent = false; });
      break;
    case Trouble::kGarbled:
      is_garbled_ = true;
      afterwards([this] { is_garbled_ = false; });
      break;
    case Trouble::kLossy:
      is_lossy_ = true;
      afterwards([this] { is_lossy_ = false; });
      break;
    case Trouble::kZeroLost:
      falcon->homed = 0x30;
      afterwards([this] { falcon->homed = falcon::kInHomed; });
      break;
    case Trouble::kGripJumps:
      jumpGrip(700);
      afterwards([this] { jumpGrip(0); });
      break;
  }
}

void FalconRun::onStream() {
  homed_seen_ = any_request_ = request_waits_ = false;
  last_report_ns_ = world.nowNs();
  bad_in_a_row_ = under_way_ = 0;
  counts_ = {};  // counts start at 0 for each link
}

// called for each command, whether it arrives or not
void FalconRun::onSend(const falcon::Command& command, std::int64_t now_ns) {
  fold(static_cast<std::uint64_t>(now_ns));
  for (const std::int16_t motor : command.motor) fold(static_cast<std::uint16_t>(motor));
  fold(command.bits);
  if (keeps_sent) sent.push_back({now_ns, command});
  if (falcon->streams == nullptr) return;  // the link asks whether the firmware runs
  if (closing_) ++sent_at_the_end_;
  if (now_ns - std::exchange(last_sent_ns_, now_ns) > Exchange::kReplyTime_ns) under_way_ = 0;
  if (++under_way_ > Exchange::kMaxUnderWay && command != falcon::Command{})
    breakRule("more than two commands under way");
  if (std::exchange(request_waits_, false)) {
    any_request_ = true;
    request_taken_ns_ = now_ns;
  }
  if (!anyTorque(command)) return;
  for (const std::int16_t motor : command.motor)
    if (std::abs(motor) > falcon::kMotorMax) breakRule(fmt::format("a motor at {} units", motor));
  if (closing_) breakRule("torque after the end");
  if (!homed_seen_) breakRule("torque without the encoders' zero");
  if (!any_request_)
    breakRule("torque that no one requested since the link was opened");
  else if (now_ns - request_taken_ns_ > Exchange::kWatchdog_ns)
    breakRule(fmt::format("torque {:.3f} ms after the haptic thread's last request",
                          1e-6 * static_cast<double>(now_ns - request_taken_ns_)));
  if (now_ns - last_report_ns_ > Exchange::kSilent_ns) breakRule("torque for a silent device");
  if (bad_in_a_row_ >= static_cast<int>(Exchange::kMaxBadInARow))
    breakRule("torque for a device that sends nonsense");
}

void FalconRun::onCommand(const falcon::Command& command, std::int64_t now_ns) {
  hand.advance(now_ns);
  hand.motors = command.motor;
  falcon->encoder = hand.encoders();
  for (std::int16_t& count : falcon->encoder) count = static_cast<std::int16_t>(count + jump_counts_);
}

void FalconRun::onReply(const std::optional<falcon::Report>& report, std::int64_t now_ns) {
  bad_in_a_row_ = report ? 0 : bad_in_a_row_ + 1;
  if (!report) return;
  if (under_way_ > 0) --under_way_;
  last_report_ns_ = now_ns;
  homed_seen_ = (report->bits & falcon::kInHomed) == falcon::kInHomed;
}

void FalconRun::onTick() {
  request_waits_ = true;
  watchTick();
  const std::uint32_t condition = haptic->reading().condition;
  if (haptic->fresh() && (condition & (kDeviceNotReady | kDeviceLost)) != 0)
    breakRule("a position from a device that has none");
  if (ticks() % 50 == 0) checkCounts();
}

void FalconRun::checkCounts() {
  const falcon::ExchangeCounts now = device->counts();
  if (now.sent < counts_.sent || now.reports < counts_.reports || now.bad_packets < counts_.bad_packets ||
      now.unanswered < counts_.unanswered || now.starved_times < counts_.starved_times)
    breakRule("a counter fell");
  if (now.reports > now.sent + 2) breakRule("more reports than commands");
  counts_ = now;
}

// a lost device is searched for every 500 ms, and when one arrives
void FalconRun::checkLooks() {
  const std::int64_t max_ns = FalconDriver::kRescan_ns + std::max(plan_.usb_late_ns, greatest_usb_late_ns_);
  for (std::size_t i = 0; i + 1 < falcon->looks.size(); ++i) {
    const Look &look = falcon->looks[i], &next = falcon->looks[i + 1];
    if (look.is_found) continue;
    const std::int64_t gap_ns = next.at_ns - look.at_ns;
    const bool arrives = std::any_of(arrivals_ns_.begin(), arrivals_ns_.end(), [&](std::int64_t at_ns) {
      return at_ns >= look.at_ns && at_ns <= next.at_ns;
    });
    if (gap_ns > max_ns)
      breakRule(fmt::format("the lost device was looked for after {} ms only", gap_ns / kMs));
    if (gap_ns < FalconDriver::kRescan_ns && !arrives)
      breakRule(fmt::format("the lost device was looked for after {} ms already", gap_ns / kMs));
  }
}

}  // namespace needlelab::test
