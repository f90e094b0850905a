#include "tests/support/time/gate_rules.h"

#include <fmt/core.h>

#include <cmath>

#include "common/haptics/engine.h"

namespace needlelab::test {

void GateRules::check(const HapticThread& haptic) {
  const ChainTick& tick = haptic.tick();
  const auto elapsed = static_cast<std::uint64_t>(haptic.elapsedTicks());
  if (any_tick_ && tick.tick != last_tick_ + elapsed)
    broken_(fmt::format("tick {} follows tick {} after {} ticks", tick.tick, last_tick_, elapsed));
  last_tick_ = tick.tick;
  any_tick_ = true;
  if (!(haptic.force_N() <= limits_.peak_force_N + kRounding_N))
    broken_(fmt::format("{} N, beyond the peak of {} N", haptic.force_N(), limits_.peak_force_N));
  if (!(norm(tick.rendered_W.torque_Nm) <= limits_.peak_torque_Nm + kRounding_N))
    broken_("a torque beyond the peak");
  checkFault(haptic);
  checkShare(haptic);
  last_force_N_ = haptic.force_N();
}

void GateRules::checkFault(const HapticThread& haptic) {
  const ForceGate& gate = haptic.gate();
  const std::uint32_t condition = haptic.reading().condition;
  const bool in_fault = gate.fault() != Fault::kNone;
  if (gate.faultsRaised() < faults_) broken_("the number of faults fell");
  const bool is_new = gate.faultsRaised() > faults_;
  faults_ = gate.faultsRaised();

  // causes
  if ((condition & kDeviceNotReady) != 0 || haptic.fresh())
    silent_ticks_ = 0;
  else
    silent_ticks_ += haptic.elapsedTicks();
  const bool is_bad = (gate.flags() & kGateSampleRejected) != 0;
  if (is_bad)
    bad_ticks_ += haptic.elapsedTicks();
  else if (haptic.fresh())
    bad_ticks_ = 0;
  if ((condition & kDeviceFaultFlags) != 0 && !in_fault)
    broken_("the device reports a fault, the gate has none");
  if (silent_ticks_ > kMostSilentTicks && !in_fault)
    broken_(fmt::format("no fault after {} silent ticks", silent_ticks_));
  if (is_bad && bad_ticks_ > kMostBadTicks && !in_fault)
    broken_(fmt::format("no fault after {} bad ticks", bad_ticks_));
  if (is_new && gate.fault() == Fault::kDeviceSilent && silent_ticks_ <= kMostSilentTicks)
    broken_(fmt::format("silent after {} ticks already", silent_ticks_));

  // effect: a straight line to zero within 20 ticks
  if (is_new) at_fault_N_ = last_force_N_;
  fault_ticks_ = is_new ? 1 : fault_ticks_ + haptic.elapsedTicks();
  if (!in_fault) return;
  const double max_N = at_fault_N_ * std::max(0.0, 1 - static_cast<double>(fault_ticks_) / kFadeOutTicks);
  if (haptic.force_N() > max_N + kRounding_N)
    broken_(
        fmt::format("{} N, {} ticks after the fault at {} N", haptic.force_N(), fault_ticks_, at_fault_N_));
}

// the share of the wanted force falls within 20 ticks and rises over 200
void GateRules::checkShare(const HapticThread& haptic) {
  const bool is_held = (haptic.reading().condition & kDeviceHoldFlags) != 0;
  const bool begins = is_held && !held_before_;
  held_before_ = is_held;
  if (haptic.gate().fault() != Fault::kNone) {
    most_share_ = 0;
    wanted_N_ = 0;
    return;
  }
  if ((haptic.tick().report.flags & kFlagNotStepped) == 0)
    wanted_N_ = norm(haptic.tick().report.wrench_W.force_N);
  const double elapsed = begins ? 1 : static_cast<double>(haptic.elapsedTicks());
  most_share_ = is_held ? std::max(0.0, most_share_ - elapsed / kFadeOutTicks)
                        : std::min(1.0, most_share_ + 1 / kFadeInTicks);
  // the limit on force changes may delay it, but not beyond the end of a fall
  if (most_share_ > 0 && (haptic.gate().flags() & kGateSlewLimited) != 0) return;
  if (haptic.force_N() > most_share_ * wanted_N_ + 1e-6)
    broken_(fmt::format("{} N of the wanted {} N, where a share of {} is the most", haptic.force_N(),
                        wanted_N_, most_share_));
}

}  // namespace needlelab::test
