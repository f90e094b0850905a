#include "tests/unit/client/device/world/virtuose_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

#include "client/device/virtuose/virtuose_errors.h"
#include "common/haptics/device_condition.h"
#include "tests/support/scenes.h"

namespace needlelab::test {
namespace {

constexpr const char* kVirtuoseTroubleNames[kVirtuoseTroubles] = {"haptic thread hangs",
                                                                  "link down",
                                                                  "service stopped",
                                                                  "slow",
                                                                  "handle released",
                                                                  "emergency stop",
                                                                  "switched off",
                                                                  "overheated",
                                                                  "failure",
                                                                  "refused",
                                                                  "bad turn",
                                                                  "handle jumps",
                                                                  "button"};
// calls that may fail, and with what; the first two are not made while the device is opened
constexpr const char* kMayFail[] = {"virtGetPosition",      "virtGetSpeed",   "virtGetDeadMan",
                                    "virtGetEmergencyStop", "virtGetPowerOn", "virtGetAlarm",
                                    "virtGetFailure",       "virtSetForce"};
constexpr int kCodes[] = {kVirtHardwareError, kVirtPositionDiscontinuity, kVirtCallTime, kVirtCommunication};
constexpr double kOutsideVirtuose_m = 0.008;

// what client/device/virtuose/README.md promises
constexpr std::int64_t kTimeout_ns = 50 * kMs, kWatchdog_ns = 2'000 * kMs, kKeepAlive_ns = 520 * kMs;
constexpr std::int64_t kFirstRetry_ns = 500 * kMs, kLongestRetry_ns = 5'000 * kMs;
constexpr std::int64_t kKeeperPause_ns = 50 * kMs, kCallsOfARead = 5;
constexpr std::int64_t kTurns = 6, kMostRefusedInARow = 1'000;
/// A command reaches the motors a cycle after the next; somebody looks each millisecond.
constexpr std::int64_t kOnItsWay_ns = 3 * kMs;
/// The longest wait between two tries, an old connection that the service holds, and a try.
constexpr std::int64_t kVirtuoseRecovery_ns = kLongestRetry_ns + kWatchdog_ns + 1'000 * kMs;
constexpr double kEncoder_m = 10e-6;

SceneModel virtuoseModelOf(const VirtuosePlan& plan, double rate_hz) {
  return *compile(plan.six_layers ? paperSixLayers() : paperOneDof(), rate_hz);
}

bool isZero(const double* six) {
  return std::all_of(six, six + 6, [](double value) { return value == 0; });
}

double inMs(std::int64_t ns) {
  return 1e-6 * static_cast<double>(ns);
}

}  // namespace

VirtuosePlan virtuosePlanOf(std::uint64_t seed) {
  Random random(seed);
  VirtuosePlan plan;
  plan.seed = seed;
  const auto upTo = [&](std::int64_t most) {
    return static_cast<std::int64_t>(random.unit() * static_cast<double>(most));
  };
  const bool is_calm = random.chance(0.2);
  plan.tick_late_ns = is_calm ? 0 : upTo(random.chance(0.2) ? 3 * kMs : kMs / 2);
  plan.keeper_late_ns = is_calm ? 0 : upTo(5 * kMs);
  plan.answer_ns = random.chance(0.5) ? upTo(kMs / 5) : 0;
  plan.prepare_ns = random.chance(0.1) ? 2'100 * kMs + upTo(600 * kMs) : upTo(30 * kMs);
  plan.lasts_ns = 100 * kMs + upTo(300 * kMs);
  plan.acknowledged_every_ns = random.chance(0.7) ? 20 * kMs + upTo(100 * kMs) : 0;
  plan.stroke_s = random.in(0.3, 1.0);
  plan.deepest_m = random.in(0.005, 0.025);
  plan.six_layers = random.chance(0.5);
  plan.ends_in_trouble = random.chance(0.1);
  for (std::uint64_t left = random.below(5); left > 0; --left) {
    PlannedVirtuoseTrouble trouble{static_cast<VirtuoseTrouble>(random.below(kVirtuoseTroubles)),
                                   upTo(plan.lasts_ns), upTo(150 * kMs)};
    switch (trouble.what) {
      case VirtuoseTrouble::kHapticHangs:
        if (random.chance(0.1)) trouble.lasts_ns = 2'000 * kMs + upTo(300 * kMs);
        break;
      case VirtuoseTrouble::kLinkDown:
      case VirtuoseTrouble::kServiceStopped:
        if (random.chance(0.2)) trouble.lasts_ns = upTo(1'200 * kMs);
        break;
      case VirtuoseTrouble::kSlow:
        trouble.amount = random.chance(0.3) ? 60 : static_cast<int>(1 + random.below(45));
        break;
      case VirtuoseTrouble::kBadTurn:
        trouble.lasts_ns = upTo(12 * kMs);
        break;
      case VirtuoseTrouble::kRefused:
        trouble.amount = static_cast<int>(random.below(std::size(kMayFail) * std::size(kCodes)));
        if (random.chance(0.2)) trouble.lasts_ns = 1'000 * kMs + upTo(200 * kMs);
        break;
      case VirtuoseTrouble::kJump:
        trouble.amount = static_cast<int>(1 + random.below(20));
        break;
      case VirtuoseTrouble::kButton:
        trouble.amount = static_cast<int>(1 + random.below(3));
        break;
      default:
        break;
    }
    plan.lasts_ns = std::max(plan.lasts_ns, trouble.at_ns + trouble.lasts_ns);
    plan.troubles.push_back(trouble);
  }
  return plan;
}

std::string textOf(const VirtuosePlan& plan) {
  std::string text = fmt::format(
      "{:.0f} ms after {:.0f} ms of preparation, ticks late by up to {:.2f} ms, keeper by {:.2f} ms, calls "
      "take "
      "{:.2f} ms",
      inMs(plan.lasts_ns), inMs(plan.prepare_ns), inMs(plan.tick_late_ns), inMs(plan.keeper_late_ns),
      inMs(plan.answer_ns));
  for (const PlannedVirtuoseTrouble& trouble : plan.troubles)
    text += fmt::format("; at {:.1f} ms for {:.1f} ms: {} ({})", inMs(trouble.at_ns), inMs(trouble.lasts_ns),
                        kVirtuoseTroubleNames[static_cast<std::size_t>(trouble.what)], trouble.amount);
  if (plan.ends_in_trouble) text += "; closed as it is";
  return text;
}

VirtuoseRun::VirtuoseRun(const VirtuosePlan& plan, double gate_rate_hz, std::uint32_t hides)
    : plan_(plan),
      hides_(hides),
      world_(plan.seed),
      random_(plan.seed ^ 0x5EED),
      model_(virtuoseModelOf(plan, gate_rate_hz)),
      answer_ns_(plan.answer_ns) {
  standin_.useTime(
      {this,
       [](void* run) { return 1e-9 * static_cast<double>(static_cast<VirtuoseRun*>(run)->world_.nowNs()); },
       [](void* run, double time_s) {
         static_cast<VirtuoseRun*>(run)->world_.sleepForNs(
             static_cast<std::int64_t>(std::ceil(time_s * 1e9)));
       }});
  standin_.command(fmt::format("place 0 0 {} 1 0 0 0", kOutsideVirtuose_m));
  standin_.command(fmt::format("slow {}", 1e-9 * static_cast<double>(answer_ns_)));

  const auto lateBy = [this](const char* thread, std::int64_t most_ns) {
    world_.wakeLate(thread, [this, most_ns] {
      return static_cast<std::int64_t>(random_.unit() * static_cast<double>(most_ns));
    });
  };
  lateBy("haptic", plan.tick_late_ns);
  lateBy("maintenance", plan.keeper_late_ns);
  lateBy("virtuose-alive", plan.keeper_late_ns);

  VirtuoseOptions options;
  options.library = kStandinLibrary;
  device_ = std::make_unique<VirtuoseDevice>(options, world_, world_);
  haptic_ = std::make_unique<HapticThread>(world_, static_cast<Device&>(*this), model_);
  haptic_->on_tick = [this] { onTick(); };
  rules_ = std::make_unique<GateRules>(info().limits, [this](const std::string& what) { breakRule(what); });
}

VirtuoseRun::~VirtuoseRun() {
  end();
}

void VirtuoseRun::play() {
  prepare();
  haptic_thread_ = world_.start(*haptic_, {"haptic", 0});
  moveHand(true);
  const std::int64_t start_ns = world_.nowNs();
  for (const PlannedVirtuoseTrouble& planned : plan_.troubles) {
    world_.at(start_ns + planned.at_ns, [this, planned] { begin(planned); });
    world_.at(start_ns + planned.at_ns + planned.lasts_ns, [this, planned] { finish(planned); });
  }
  if (plan_.acknowledged_every_ns > 0)
    for (std::int64_t at = 0; at < plan_.lasts_ns; at += plan_.acknowledged_every_ns)
      world_.at(start_ns + at, [this] { acknowledge(); });
  if (plan_.ends_in_trouble) {
    world_.sleepForNs(plan_.lasts_ns / 2);
  } else {
    world_.sleepUntilNs(start_ns + plan_.lasts_ns);
    recover();
  }
  end();
}

// the device is open, no loop runs: zero force keeps the connection
void VirtuoseRun::prepare() {
  if (const Status done = device_->open(1000); !done.ok()) throw std::runtime_error(done.error().message);
  observer_ = world_.start(*this, {"observer", 0});
  keeper_ = std::make_unique<DeviceMaintenance>(static_cast<Device&>(*this), world_, world_);
  const long before = standin_.state().exchanges;
  world_.sleepForNs(plan_.prepare_ns);
  const StandinState state = standin_.state();
  const std::int64_t expected =
      plan_.prepare_ns / (kKeepAlive_ns + plan_.keeper_late_ns + plan_.answer_ns + kMs);
  if (state.exchanges - before < expected)
    breakRule(fmt::format("{} zero forces during the preparation", state.exchanges - before));
  if (state.openings != 1) breakRule("the connection was lost during the preparation");
}

// the troubles are over, a person acknowledges, the hand is outside: the device is as before in time
void VirtuoseRun::recover() {
  endTroubles();
  const std::int64_t last_ns = world_.nowNs() + kVirtuoseRecovery_ns;
  int good_ticks = 0;
  while (good_ticks < 10 && world_.nowNs() < last_ns && broken_.empty()) {
    acknowledge();
    world_.sleepForNs(kMs);
    const bool is_good = haptic_->gate().fault() == Fault::kNone && haptic_->fresh() &&
                         haptic_->reading().condition == 0 && standin_.state().alarms == 0;
    good_ticks = is_good ? good_ticks + 1 : 0;
  }
  if (good_ticks < 10)
    breakRule(fmt::format("no recovery within {} ms: fault '{}', condition {:#x}, status '{}'",
                          kVirtuoseRecovery_ns / kMs, faultText(haptic_->gate().fault()),
                          haptic_->reading().condition, device_->status()));
  else if (const std::string text = device_->status(); !text.empty())
    breakRule("all is well, and the status is: " + text);
}

void VirtuoseRun::end() {
  if (observer_ == nullptr) return;
  haptic_->stop();
  haptic_thread_.reset();
  keeper_.reset();
  const StandinState before = standin_.state();
  const std::int64_t since_ns = world_.nowNs();
  const bool was_good = was_fresh_ && !linkIsBroken() && !isCut() && refused_.empty();
  device_->close();
  const StandinState after = standin_.state();
  // a link that changed after the last tick may have been lost unseen
  if (was_good && link_changed_ns_ < haptic_->lastTickNs() && broken_.empty()) {
    if (after.exchanges != before.exchanges + 1) breakRule("the device was closed without a zero force");
    if (after.is_permitted != 0 || after.open_contexts != 0) breakRule("power or connection outlive the end");
    if (!isZero(after.commanded)) breakRule("a force outlives the end");
    if (!standin_.calls().ends_with("virtSetForce virtSetPowerOn virtClose"))
      breakRule("the last calls are in another order");
  }
  // the service hears the end at the latest by the silence
  world_.sleepForNs(was_good ? 20 * kMs : kWatchdog_ns + kOnItsWay_ns);
  const StandinState last = standin_.state();
  if (last.exchanges != after.exchanges) breakRule("a command after the end");
  if (last.open_contexts != 0)
    breakRule(fmt::format("a connection {} ms after the end", inMs(world_.nowNs() - since_ns)));
  if (!isZero(last.felt)) breakRule("a force after the end");
  observer_stops_ = true;
  observer_.reset();
}

// in and out at constant speed
void VirtuoseRun::moveHand(bool inwards) {
  if (plan_.stroke_s <= 0) return;
  const double way_s = plan_.stroke_s / 2;
  standin_.command(
      fmt::format("hand 0 0 {} 1 0 0 0 {}", inwards ? -plan_.deepest_m : kOutsideVirtuose_m, way_s));
  world_.at(world_.nowNs() + static_cast<std::int64_t>(way_s * 1e9), [this, inwards] { moveHand(!inwards); });
}

void VirtuoseRun::acknowledge() {
  haptic_->acknowledge();
  acknowledged_ = true;
}

void VirtuoseRun::breakRule(const std::string& what) {
  if (broken_.empty()) broken_ = fmt::format("at {:.3f} ms: {}", inMs(world_.nowNs()), what);
}

void VirtuoseRun::fold(std::uint64_t value) {
  trace_ = (trace_ ^ value) * 0x100000001b3ull;
}

// ---- what goes wrong

void VirtuoseRun::begin(const PlannedVirtuoseTrouble& planned) {
  switch (planned.what) {
    case VirtuoseTrouble::kHapticHangs:
      haptic_->hangUntil(world_.nowNs() + planned.lasts_ns);
      return;
    case VirtuoseTrouble::kLinkDown:
      standin_.command(fmt::format("link_down {}", 1e-9 * static_cast<double>(planned.lasts_ns)));
      link_back_ns_ = world_.nowNs() + planned.lasts_ns;
      break;
    case VirtuoseTrouble::kServiceStopped:
      standin_.command("daemon 0");
      service_runs_ = false;
      break;
    case VirtuoseTrouble::kSlow:
      standin_.command(fmt::format("slow {}", 1e-3 * planned.amount));
      answer_ns_ = planned.amount * kMs;
      break;
    case VirtuoseTrouble::kReleased:
      standin_.command("dead_man 0");
      held_ = false;
      break;
    case VirtuoseTrouble::kEmergencyStop:
      standin_.command("estop press");
      stopped_ = true;
      break;
    case VirtuoseTrouble::kSwitchedOff:
      standin_.command("switch 0");
      break;
    case VirtuoseTrouble::kOverheated:
      standin_.command("overheat 1");
      break;
    case VirtuoseTrouble::kFailure:
      standin_.command("failure 1");
      has_failure_ = true;
      break;
    case VirtuoseTrouble::kRefused: {
      const auto code = static_cast<std::size_t>(planned.amount) % std::size(kCodes);
      if (!refused_.empty()) standin_.command("fail " + refused_ + " 0");
      refused_ = kMayFail[static_cast<std::size_t>(planned.amount) / std::size(kCodes)];
      standin_.command(fmt::format("fail {} {}", refused_, kCodes[code]));
      break;
    }
    case VirtuoseTrouble::kBadTurn:
      standin_.command("bad_turn 1.1");
      break;
    case VirtuoseTrouble::kJump:
      standin_.command(fmt::format("jump 0 0 {}", -1e-3 * planned.amount));
      break;
    case VirtuoseTrouble::kButton:
      standin_.command(fmt::format("button {} 1", planned.amount));
      buttons_ |= 1u << (planned.amount - 1);
      break;
  }
  truthChanges();
}

void VirtuoseRun::finish(const PlannedVirtuoseTrouble& planned) {
  switch (planned.what) {
    case VirtuoseTrouble::kHapticHangs:
    case VirtuoseTrouble::kJump:
      return;
    case VirtuoseTrouble::kLinkDown:
      // the end of a connection may not have been heard
      maybe_left_open_until_ns_ = now() + kWatchdog_ns + kOnItsWay_ns;
      break;
    case VirtuoseTrouble::kServiceStopped:
      standin_.command("daemon 1");
      service_runs_ = true;
      break;
    case VirtuoseTrouble::kSlow:
      standin_.command(fmt::format("slow {}", 1e-9 * static_cast<double>(plan_.answer_ns)));
      if (linkIsBroken()) maybe_left_open_until_ns_ = world_.nowNs() + kWatchdog_ns + kOnItsWay_ns;
      answer_ns_ = plan_.answer_ns;
      break;
    case VirtuoseTrouble::kReleased:
      standin_.command("dead_man 1");
      held_ = true;
      break;
    case VirtuoseTrouble::kEmergencyStop:
      standin_.command("estop free");
      standin_.command("switch 1");
      stopped_ = false;
      break;
    case VirtuoseTrouble::kSwitchedOff:
      standin_.command("switch 1");
      break;
    case VirtuoseTrouble::kOverheated:
      standin_.command("overheat 0");
      break;
    case VirtuoseTrouble::kFailure:
      standin_.command("failure 0");
      has_failure_ = false;
      break;
    case VirtuoseTrouble::kRefused:
      if (!refused_.empty()) standin_.command("fail " + refused_ + " 0");
      refused_.clear();
      break;
    case VirtuoseTrouble::kBadTurn:
      standin_.command("bad_turn 1");
      break;
    case VirtuoseTrouble::kButton:
      standin_.command(fmt::format("button {} 0", planned.amount));
      buttons_ &= ~(1u << (planned.amount - 1));
      break;
  }
  truthChanges();
}

// each has ended by itself; the hand goes outside
void VirtuoseRun::endTroubles() {
  plan_.stroke_s = 0;
  standin_.command(fmt::format("hand 0 0 {} 1 0 0 0 0.1", kOutsideVirtuose_m));
}

void VirtuoseRun::truthChanges() {
  ++truth_changes_;
  fresh_in_a_row_ = 0;
  link_changed_ns_ = world_.nowNs();
}

bool VirtuoseRun::linkIsBroken() const {
  return !service_runs_ || now() < link_back_ns_ || answer_ns_ >= kTimeout_ns;
}

bool VirtuoseRun::isCut() const {
  return now() - last_sent_ns_ > kWatchdog_ns - kOnItsWay_ns;
}

// ---- the rules

DeviceRead VirtuoseRun::read(DeviceReading& reading) noexcept {
  const std::int64_t since_ns = now();
  const std::uint64_t changes = truth_changes_;
  const bool was_broken = linkIsBroken();
  const DeviceRead read = device_->read(reading);
  reading.condition &= ~hides_;
  if (now() - since_ns > kCallsOfARead * kTimeout_ns + kMs)
    breakRule("a reading takes longer than its calls may");

  was_fresh_ = read == DeviceRead::kFresh;
  if (!was_fresh_) {
    fresh_in_a_row_ = 0;
    checkStale(reading, since_ns, was_broken);
    return read;
  }
  was_lost_ = false;
  refused_in_a_row_ = 0;
  if (was_broken && linkIsBroken() && truth_changes_ == changes)
    breakRule("a fresh position through a broken link");
  // what changes during the calls may be read before or after
  if (truth_changes_ == changes) {
    ++fresh_in_a_row_;
    checkFresh(reading, since_ns);
  }
  return read;
}

void VirtuoseRun::checkFresh(const DeviceReading& reading, std::int64_t since_ns) {
  const auto says = [&](std::uint32_t flag) { return (reading.condition & flag) != 0; };
  if (says(kDeviceReleased) == held_) breakRule("the dead man is told wrongly");
  if (says(kDeviceEmergencyStop) != stopped_) breakRule("the emergency stop is told wrongly");
  if (says(kDeviceLost)) breakRule("a position from a lost device");
  const StandinState state = standin_.state();
  if (now() == since_ns)
    for (const double error_m :
         {reading.X_WH.p.x - state.position_m[0], reading.X_WH.p.y - state.position_m[1],
          reading.X_WH.p.z - state.position_m[2]})
      if (std::abs(error_m) > kEncoder_m) breakRule(fmt::format("a position off by {} m", error_m));
  // one of these is asked each tick
  if (fresh_in_a_row_ < kTurns) return;
  if (says(kDevicePowerOff) != (state.is_powered == 0)) breakRule("the power is told wrongly");
  if (says(kDeviceOverheated) != ((state.alarms & kVirtAlarmOverheat) != 0))
    breakRule("the heat is told wrongly");
  if (refused_.empty() && says(kDeviceTrouble) != has_failure_) breakRule("a failure is told wrongly");
  if (reading.buttons != buttons_) breakRule("the buttons are told wrongly");
}

void VirtuoseRun::checkStale(const DeviceReading& reading, std::int64_t since_ns, bool was_broken) {
  const std::uint32_t condition = reading.condition;
  if ((condition & (kDeviceFaultFlags | kDeviceNotReady)) == 0) breakRule("no position, and no reason");
  const bool is_lost = (condition & kDeviceLost) != 0;
  if (was_broken && linkIsBroken() && refused_.empty() && !is_lost && condition != kDeviceNotReady)
    breakRule(fmt::format("the link is broken, the condition {:#x}", condition));
  refused_in_a_row_ = is_lost ? 0 : refused_in_a_row_ + 1;
  if (refused_in_a_row_ > kMostRefusedInARow)
    breakRule("a device that refuses for more than a second is not opened anew");
  if (is_lost && was_lost_ && now() != since_ns) breakRule("the haptic thread waits for a lost device");
  if (is_lost && was_lost_ && reading.buttons != 0) breakRule("a lost device has buttons");
  if (is_lost && !was_lost_) lost_since_ns_ = now();
  was_lost_ = is_lost;
}

void VirtuoseRun::write(const GuardedWrench& at_handle_W) noexcept {
  const Wrench& wrench = at_handle_W.wrench();
  const double six[6] = {wrench.force_N.x,   wrench.force_N.y,   wrench.force_N.z,
                         wrench.torque_Nm.x, wrench.torque_Nm.y, wrench.torque_Nm.z};
  const std::uint64_t changes = truth_changes_;
  const long before = standin_.state().exchanges;
  const bool was_broken = linkIsBroken();
  device_->write(at_handle_W);
  const StandinState state = standin_.state();
  if (state.exchanges == before) {
    if (was_fresh_ && !was_broken && !isCut() && truth_changes_ == changes &&
        link_changed_ns_ < last_read_ns_ && refused_.empty())
      breakRule("a wrench is not sent");
    return;
  }
  last_sent_ns_ = now();
  for (std::size_t i = 0; i < 6; ++i) last_wrench_[i] = static_cast<double>(static_cast<float>(six[i]));
  if (!std::equal(last_wrench_.begin(), last_wrench_.end(), state.commanded))
    breakRule("another wrench is sent");
}

void VirtuoseRun::maintain() {
  const std::int64_t since_ns = now();
  const std::uint64_t changes = truth_changes_;
  const bool was_broken = linkIsBroken();
  const long openings = standin_.state().openings;
  device_->maintain();
  const StandinState state = standin_.state();
  if (state.openings == openings) return;
  if (state.openings != openings + 1) breakRule("more than one try at a time");
  const bool has_connected = !device_->status().starts_with("the link is lost");
  const bool asks_what_fails = !refused_.empty() && refused_ != kMayFail[0] && refused_ != kMayFail[1];
  const bool may_fail = was_broken || linkIsBroken() || truth_changes_ != changes || asks_what_fails ||
                        since_ns <= maybe_left_open_until_ns_;
  if (!has_connected && !may_fail) breakRule("the device is there, and a try does not find it");
  if (has_connected && (state.is_permitted == 0 || !isZero(state.commanded)))
    breakRule("opened anew without permission of power, or with a force");
  checkTry(since_ns);
  fold(static_cast<std::uint64_t>(since_ns));
  fold(has_connected ? 1 : 0);
  any_try_ = true;
  last_try_end_ns_ = now();
  failed_tries_ = has_connected ? 0 : failed_tries_ + 1;
  if (!has_connected) return;
  was_lost_ = false;
  refused_in_a_row_ = 0;
  ++reconnections_;
}

// after 0.5, 1, 2, 4 and then every 5 s
void VirtuoseRun::checkTry(std::int64_t since_ns) {
  const std::int64_t most_late_ns = kKeeperPause_ns + plan_.keeper_late_ns;
  std::int64_t due_ns = any_try_ ? last_try_end_ns_ + kFirstRetry_ns : 0;
  if (failed_tries_ > 0)
    due_ns = last_try_end_ns_ +
             std::min(kFirstRetry_ns << std::min<std::uint64_t>(failed_tries_ - 1, 10), kLongestRetry_ns);
  if (since_ns < due_ns) breakRule(fmt::format("a try {} ms too early", inMs(due_ns - since_ns)));
  if (failed_tries_ == 0 && !was_lost_) return;  // the haptic thread does not know yet that it is lost
  if (failed_tries_ == 0) due_ns = std::max(due_ns, lost_since_ns_);
  if (since_ns > due_ns + most_late_ns) breakRule(fmt::format("a try {} ms late", inMs(since_ns - due_ns)));
}

std::optional<std::int64_t> VirtuoseRun::turn() noexcept {
  if (observer_stops_) return std::nullopt;
  const StandinState state = standin_.state();
  if (state.open_contexts > 1) breakRule("two connections");
  const bool is_zero = isZero(state.commanded);
  if (!is_zero && !std::equal(last_wrench_.begin(), last_wrench_.end(), state.commanded))
    breakRule("the device has a wrench that nobody wished");
  const bool is_wish = !isZero(last_wrench_.data());
  if (!isZero(state.felt) && now() - last_sent_ns_ > (is_wish ? kWatchdog_ns : 0) + kOnItsWay_ns)
    breakRule(fmt::format("a force {} ms after the last wish", inMs(now() - last_sent_ns_)));
  return now() + kMs;
}

void VirtuoseRun::onTick() {
  ++ticks_;
  last_read_ns_ = haptic_->lastTickNs();
  fold(static_cast<std::uint64_t>(now()));
  fold(std::bit_cast<std::uint64_t>(haptic_->force_N()));
  fold(haptic_->reading().condition);
  const ForceGate& gate = haptic_->gate();
  fold(static_cast<std::uint64_t>(gate.fault()));
  rules_->check(*haptic_);
  const bool is_in_fault = gate.fault() != Fault::kNone;
  if (gate.faultsRaised() > faults_) acknowledged_ = false;
  faults_ = gate.faultsRaised();
  if (in_fault_ && !is_in_fault && !acknowledged_) breakRule("a fault ends without an acknowledgement");
  if (!is_in_fault) acknowledged_ = false;
  in_fault_ = is_in_fault;
}

}  // namespace needlelab::test
