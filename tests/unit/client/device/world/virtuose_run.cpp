#include "tests/unit/client/device/world/virtuose_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "client/device/virtuose/virtuose_errors.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab::test {
namespace {

constexpr double kOutsideVirtuose_m = 0.008;

// promised by client/device/virtuose/README.md
constexpr std::int64_t kTimeout_ns = 50 * kMs, kWatchdog_ns = 2'000 * kMs, kKeepAlive_ns = 520 * kMs;
constexpr std::int64_t kFirstRetry_ns = 500 * kMs, kLongestRetry_ns = 5'000 * kMs;
constexpr std::int64_t kKeeperPause_ns = 50 * kMs, kCallsOfARead = 5;
constexpr std::int64_t kTurns = 6, kMostRefusedInARow = 1'000;
/// A command reaches the motors one cycle after the next; the checks run every millisecond.
constexpr std::int64_t kOnItsWay_ns = 3 * kMs;
/// The longest wait between two attempts, plus an old connection that the service holds, plus an attempt.
constexpr std::int64_t kVirtuoseRecovery_ns = kLongestRetry_ns + kWatchdog_ns + 1'000 * kMs;
constexpr double kEncoder_m = 10e-6;

bool isZero(const double* six) {
  return std::all_of(six, six + 6, [](double value) { return value == 0; });
}

double inMs(std::int64_t ns) {
  return 1e-6 * static_cast<double>(ns);
}

}  // namespace

VirtuoseRun::VirtuoseRun(const VirtuosePlan& plan, std::uint32_t hides)
    : WorldRun(plan, 1000), plan_(plan), hides_(hides), answer_ns_(plan.answer_ns) {
  standin_.useTime(
      {this, [](void* run) { return 1e-9 * static_cast<double>(static_cast<VirtuoseRun*>(run)->now()); },
       [](void* run, double time_s) {
         static_cast<VirtuoseRun*>(run)->world.sleepForNs(static_cast<std::int64_t>(std::ceil(time_s * 1e9)));
       }});
  standin_.command(fmt::format("place 0 0 {} 1 0 0 0", kOutsideVirtuose_m));
  standin_.command(fmt::format("slow {}", 1e-9 * static_cast<double>(answer_ns_)));

  lateBy("maintenance", plan.keeper_late_ns);
  lateBy("virtuose-alive", plan.keeper_late_ns);

  VirtuoseOptions options;
  options.library = kStandinLibrary;
  device_ = std::make_unique<VirtuoseDevice>(options, world, world);
  useDevice(static_cast<Device&>(*this), [this] { onTick(); });
}

VirtuoseRun::~VirtuoseRun() {
  end();
}

void VirtuoseRun::play() {
  prepare();
  haptic_thread_ = world.start(*haptic, {"haptic", 0});
  moveHand(true);
  const std::int64_t start_ns = now();
  for (const PlannedVirtuoseTrouble& planned : plan_.troubles) {
    world.at(start_ns + planned.at_ns, [this, planned] { begin(planned); });
    world.at(start_ns + planned.at_ns + planned.lasts_ns, [this, planned] { finish(planned); });
  }
  acknowledgeAsPlanned(plan_);
  if (plan_.ends_in_trouble) {
    world.sleepForNs(plan_.lasts_ns / 2);
  } else {
    world.sleepUntilNs(start_ns + plan_.lasts_ns);
    recover();
  }
  end();
}

// the device is open and no loop runs: zero force keeps the connection alive
void VirtuoseRun::prepare() {
  if (const Status done = device_->open(1000); !done.ok()) throw std::runtime_error(done.error().message);
  observer_ = world.start(*this, {"observer", 0});
  keeper_ = std::make_unique<DeviceMaintenance>(static_cast<Device&>(*this), world, world);
  const long before = standin_.state().exchanges;
  world.sleepForNs(plan_.prepare_ns);
  const StandinState state = standin_.state();
  const std::int64_t expected =
      plan_.prepare_ns / (kKeepAlive_ns + plan_.keeper_late_ns + plan_.answer_ns + kMs);
  if (state.exchanges - before < expected)
    breakRule(fmt::format("{} zero forces during the preparation", state.exchanges - before));
  if (state.openings != 1) breakRule("the connection was lost during the preparation");
}

// the troubles are over, a person acknowledges, the hand is outside: the device recovers in time
void VirtuoseRun::recover() {
  endTroubles();
  recoverWithin(kVirtuoseRecovery_ns, [this] {
    return haptic->fresh() && haptic->reading().condition == 0 && standin_.state().alarms == 0;
  });
  if (const std::string text = device_->status(); broken().empty() && !text.empty())
    breakRule("all is well, and the status is: " + text);
}

void VirtuoseRun::end() {
  if (observer_ == nullptr) return;
  haptic->stop();
  haptic_thread_.reset();
  keeper_.reset();
  const StandinState before = standin_.state();
  const std::int64_t since_ns = now();
  const bool was_good = was_fresh_ && !linkIsBroken() && !isCut() && refused_.empty();
  device_->close();
  const StandinState after = standin_.state();
  // a link that changed after the last tick may have been lost unnoticed
  if (was_good && link_changed_ns_ < haptic->lastTickNs() && broken().empty()) {
    if (after.exchanges != before.exchanges + 1) breakRule("the device was closed without a zero force");
    if (after.is_permitted != 0 || after.open_contexts != 0) breakRule("power or connection outlive the end");
    if (!isZero(after.commanded)) breakRule("a force outlives the end");
    if (!standin_.calls().ends_with("virtSetForce virtSetPowerOn virtClose"))
      breakRule("the last calls are in another order");
  }
  // the service notices the end by the silence at the latest; needed when the link breaks during the last
  // calls
  const bool is_heard = was_good && link_changed_ns_ <= since_ns;
  world.sleepForNs(is_heard ? 20 * kMs : kWatchdog_ns + kOnItsWay_ns);
  const StandinState last = standin_.state();
  if (last.exchanges != after.exchanges) breakRule("a command after the end");
  if (last.open_contexts != 0)
    breakRule(fmt::format("a connection {} ms after the end", inMs(now() - since_ns)));
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
  world.at(now() + static_cast<std::int64_t>(way_s * 1e9), [this, inwards] { moveHand(!inwards); });
}

void VirtuoseRun::acknowledge() {
  WorldRun::acknowledge();
  // it does not count before a tick without the cause
  if (!haptic->gate().causeLasts()) acknowledged_ = true;
}

// ---- troubles

void VirtuoseRun::command(const char* commands, const PlannedVirtuoseTrouble& planned) {
  std::istringstream all(fmt::format(fmt::runtime(commands), fmt::arg("amount", planned.amount),
                                     fmt::arg("milli", 1e-3 * planned.amount),
                                     fmt::arg("lasts_s", 1e-9 * static_cast<double>(planned.lasts_ns)),
                                     fmt::arg("answer_s", 1e-9 * static_cast<double>(plan_.answer_ns))));
  for (std::string one; std::getline(all, one, ';');) standin_.command(one);
}

void VirtuoseRun::begin(const PlannedVirtuoseTrouble& planned) {
  command(rowOf(planned.what).begins, planned);
  switch (planned.what) {
    case VirtuoseTrouble::kHapticHangs:
      haptic->hangUntil(now() + planned.lasts_ns);
      return;
    case VirtuoseTrouble::kLinkDown:
      link_back_ns_ = now() + planned.lasts_ns;
      break;
    case VirtuoseTrouble::kSlow:
      answer_ns_ = planned.amount * kMs;
      break;
    case VirtuoseTrouble::kRefused: {
      const auto [function, code] = refusedCall(planned.amount);
      if (!refused_.empty()) standin_.command("fail " + refused_ + " 0");
      refused_ = function;
      standin_.command(fmt::format("fail {} {}", refused_, code));
      break;
    }
    case VirtuoseTrouble::kButton:
      buttons_ |= 1u << (planned.amount - 1);
      break;
    default:
      setTruth(planned.what, true);
  }
  truthChanges();
}

void VirtuoseRun::finish(const PlannedVirtuoseTrouble& planned) {
  command(rowOf(planned.what).ends, planned);
  // the service may have missed the end of a connection
  const std::int64_t unheard_until_ns = now() + kWatchdog_ns + kOnItsWay_ns;
  switch (planned.what) {
    case VirtuoseTrouble::kHapticHangs:
    case VirtuoseTrouble::kJump:
      return;
    case VirtuoseTrouble::kLinkDown:
      maybe_left_open_until_ns_ = unheard_until_ns;
      break;
    case VirtuoseTrouble::kSlow:
      if (linkIsBroken()) maybe_left_open_until_ns_ = unheard_until_ns;
      answer_ns_ = plan_.answer_ns;
      break;
    case VirtuoseTrouble::kRefused:
      if (!refused_.empty()) standin_.command("fail " + refused_ + " 0");
      refused_.clear();
      break;
    case VirtuoseTrouble::kButton:
      buttons_ &= ~(1u << (planned.amount - 1));
      break;
    default:
      setTruth(planned.what, false);
  }
  truthChanges();
}

void VirtuoseRun::setTruth(VirtuoseTrouble trouble, bool begins) {
  if (trouble == VirtuoseTrouble::kServiceStopped) service_runs_ = !begins;
  if (trouble == VirtuoseTrouble::kReleased) held_ = !begins;
  if (trouble == VirtuoseTrouble::kEmergencyStop) stopped_ = begins;
  if (trouble == VirtuoseTrouble::kFailure) has_failure_ = begins;
}

// each one ended by itself; the hand goes outside
void VirtuoseRun::endTroubles() {
  plan_.stroke_s = 0;
  standin_.command(fmt::format("hand 0 0 {} 1 0 0 0 0.1", kOutsideVirtuose_m));
}

void VirtuoseRun::truthChanges() {
  ++truth_changes_;
  fresh_in_a_row_ = 0;
  link_changed_ns_ = now();
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
  // what changes during the calls may be read before or after the change
  if (truth_changes_ == changes) {
    ++fresh_in_a_row_;
    checkFresh(reading, since_ns);
  }
  return read;
}

void VirtuoseRun::checkFresh(const DeviceReading& reading, std::int64_t since_ns) {
  const auto says = [&](std::uint32_t flag) { return (reading.condition & flag) != 0; };
  if (says(kDeviceReleased) == held_) breakRule("the dead man is reported wrongly");
  if (says(kDeviceEmergencyStop) != stopped_) breakRule("the emergency stop is reported wrongly");
  if (says(kDeviceLost)) breakRule("a position from a lost device");
  const StandinState state = standin_.state();
  if (now() == since_ns)
    for (const double error_m :
         {reading.X_WH.p.x - state.position_m[0], reading.X_WH.p.y - state.position_m[1],
          reading.X_WH.p.z - state.position_m[2]})
      if (std::abs(error_m) > kEncoder_m) breakRule(fmt::format("a position off by {} m", error_m));
  // one of these is read each tick
  if (fresh_in_a_row_ < kTurns) return;
  if (says(kDevicePowerOff) != (state.is_powered == 0)) breakRule("the power is reported wrongly");
  if (says(kDeviceOverheated) != ((state.alarms & kVirtAlarmOverheat) != 0))
    breakRule("the heat is reported wrongly");
  if (refused_.empty() && says(kDeviceTrouble) != has_failure_) breakRule("a failure is reported wrongly");
  if (reading.buttons != buttons_) breakRule("the buttons are reported wrongly");
}

void VirtuoseRun::checkStale(const DeviceReading& reading, std::int64_t since_ns, bool was_broken) {
  const std::uint32_t condition = reading.condition;
  if ((condition & (kDeviceFaultFlags | kDeviceNotReady)) == 0) breakRule("no position, and no reason");
  const bool is_lost = (condition & kDeviceLost) != 0;
  if (was_broken && linkIsBroken() && refused_.empty() && !is_lost && condition != kDeviceNotReady)
    breakRule(fmt::format("the link is broken, the condition {:#x}", condition));
  refused_in_a_row_ = is_lost ? 0 : refused_in_a_row_ + 1;
  if (refused_in_a_row_ > kMostRefusedInARow)
    breakRule("a device that refuses for more than a second is not opened again");
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
  // opening the device reads neither position nor speed
  const bool asks_what_fails =
      !refused_.empty() && refused_ != "virtGetPosition" && refused_ != "virtGetSpeed";
  const bool may_fail = was_broken || linkIsBroken() || truth_changes_ != changes || asks_what_fails ||
                        since_ns <= maybe_left_open_until_ns_;
  if (!has_connected && !may_fail) breakRule("the device is there, and a try does not find it");
  if (has_connected && (state.is_permitted == 0 || !isZero(state.commanded)))
    breakRule("opened again without permission of power, or with a force");
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

// after 0.5, 1, 2, 4 s and then every 5 s
void VirtuoseRun::checkTry(std::int64_t since_ns) {
  const std::int64_t most_late_ns = kKeeperPause_ns + plan_.keeper_late_ns;
  std::int64_t due_ns = any_try_ ? last_try_end_ns_ + kFirstRetry_ns : 0;
  if (failed_tries_ > 0)
    due_ns = last_try_end_ns_ +
             std::min(kFirstRetry_ns << std::min<std::uint64_t>(failed_tries_ - 1, 10), kLongestRetry_ns);
  if (since_ns < due_ns) breakRule(fmt::format("a try {} ms too early", inMs(due_ns - since_ns)));
  if (failed_tries_ == 0 && !was_lost_) return;  // not yet noticed by the haptic thread
  if (failed_tries_ == 0) due_ns = std::max(due_ns, lost_since_ns_);
  if (since_ns > due_ns + most_late_ns) breakRule(fmt::format("a try {} ms late", inMs(since_ns - due_ns)));
}

std::optional<std::int64_t> VirtuoseRun::turn() noexcept {
  if (observer_stops_) return std::nullopt;
  const StandinState state = standin_.state();
  if (state.open_contexts > 1) breakRule("two connections");
  const bool is_zero = isZero(state.commanded);
  if (!is_zero && !std::equal(last_wrench_.begin(), last_wrench_.end(), state.commanded))
    breakRule("the device has a wrench that no one wished");
  const bool is_wish = !isZero(last_wrench_.data());
  if (!isZero(state.felt) && now() - last_sent_ns_ > (is_wish ? kWatchdog_ns : 0) + kOnItsWay_ns)
    breakRule(fmt::format("a force {} ms after the last wish", inMs(now() - last_sent_ns_)));
  return now() + kMs;
}

void VirtuoseRun::onTick() {
  last_read_ns_ = haptic->lastTickNs();
  watchTick();
  const ForceGate& gate = haptic->gate();
  const bool is_in_fault = gate.fault() != Fault::kNone;
  if (gate.faultsRaised() > faults_) acknowledged_ = false;
  faults_ = gate.faultsRaised();
  if (in_fault_ && !is_in_fault && !acknowledged_) breakRule("a fault ends without an acknowledgement");
  if (!is_in_fault) acknowledged_ = false;
  in_fault_ = is_in_fault;
}

}  // namespace needlelab::test
