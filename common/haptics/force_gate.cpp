#include "common/haptics/force_gate.h"

#include <algorithm>
#include <cmath>

#include "common/haptics/device_condition.h"

namespace needlelab {
namespace {

constexpr double kFadeIn_s = 0.2;    // start-up
constexpr double kFadeOut_s = 0.02;  // a fault removes the force within this time
constexpr double kSlewForce_N_per_s = 2000;
constexpr double kSlewTorque_Nm_per_s = 100;
constexpr double kMaxTipSpeed_mps = 5;
constexpr std::int64_t kHoldTicks = 5;  // number of rejected samples for which the last force is held
constexpr double kWatchdog_s = 0.02;    // silence of the device after which the force is removed

bool limitMagnitude(Vec3& v, double most) noexcept {
  const double size = norm(v);
  if (size <= most) return false;
  v = v * (most / size);
  return true;
}

bool limitChange(Vec3& v, Vec3 from, double most) noexcept {
  Vec3 change = v - from;
  if (!limitMagnitude(change, most)) return false;
  v = from + change;
  return true;
}

bool isFinite(const Wrench& w) noexcept {
  return needlelab::isFinite(w.force_N) && needlelab::isFinite(w.torque_Nm);
}

Wrench scaled(const Wrench& w, double s) noexcept {
  return {w.force_N * s, w.torque_Nm * s};
}

// the fault that the device itself reports; a person's action comes first
Fault faultSaid(std::uint32_t condition) noexcept {
  if ((condition & kDeviceEmergencyStop) != 0) return Fault::kEmergencyStop;
  if ((condition & kDeviceLost) != 0) return Fault::kDeviceLost;
  if ((condition & kDeviceOverheated) != 0) return Fault::kDeviceOverheated;
  if ((condition & kDeviceTrouble) != 0) return Fault::kDeviceTrouble;
  return Fault::kNone;
}

}  // namespace

ForceGate::ForceGate(const DeviceLimits& limits, double rate_hz)
    : limits_(limits),
      period_s_(1.0 / rate_hz),
      fade_in_step_(std::min(1.0, period_s_ / kFadeIn_s)),
      fade_out_step_(1.0 / std::max(1.0, std::floor(kFadeOut_s * rate_hz))),
      slew_force_N_(kSlewForce_N_per_s * period_s_),
      slew_torque_Nm_(kSlewTorque_Nm_per_s * period_s_),
      silent_limit_ticks_(
          std::max<std::int64_t>(kHoldTicks, static_cast<std::int64_t>(kWatchdog_s * rate_hz + 0.5))),
      force_budget_(limits.peak_force_N, limits.continuous_force_N, period_s_),
      torque_budget_(limits.peak_torque_Nm, limits.continuous_torque_Nm, period_s_) {}

Fault ForceGate::judge(const TipSample& tip) const noexcept {
  if (!isFinite(tip.p_WT_m) || !needlelab::isFinite(tip.q_WT)) return Fault::kSampleNotFinite;
  if (std::fabs(std::sqrt(dot(tip.q_WT, tip.q_WT)) - 1.0) > 1e-3) return Fault::kOrientationInvalid;
  const double reach_m = kMaxTipSpeed_mps * period_s_ * static_cast<double>(ticks_since_good_);
  if (have_good_ && norm(tip.p_WT_m - last_good_p_W_m_) > reach_m) return Fault::kTipTooFast;
  return Fault::kNone;
}

void ForceGate::raise(Fault fault) noexcept {
  fault_ = fault;
  at_fault_ = out_;
  fade_ = 1.0;
  elapsed_ticks_ = 1;  // ticks missed before do not count for the ramp
  acknowledged_ = false;
  outside_ = false;
  ++faults_raised_;
  cause_lasts_ = true;
  bad_in_fault_ = false;
  after_stall_ = false;
}

void ForceGate::raiseFromOutside(Fault fault) noexcept {
  cause_outside_ = true;
  if (fault_ == Fault::kNone) raise(fault);
}

// the motors also warmed up during missed ticks: the device kept rendering the last force
void ForceGate::spendMissed(std::int64_t ticks) noexcept {
  constexpr std::int64_t kMost = 20'000;  // 2 s at 10 kHz: no device renders longer than that by itself
  const double force_N = norm(out_.force_N), torque_Nm = norm(out_.torque_Nm);
  for (std::int64_t i = std::min(ticks, kMost); i > 0; --i) {
    force_budget_.spend(force_N);
    torque_budget_.spend(torque_Nm);
  }
}

// the time since the device's last update; ticks that the loop itself missed count, too
void ForceGate::noteSilence(bool fresh, std::int64_t elapsed_ticks, std::uint32_t condition) noexcept {
  if ((condition & kDeviceNotReady) != 0) {
    silent_ticks_ = 0;  // the device reports the reason of its silence, and has no force
  } else if (!fresh) {
    silent_ticks_ += elapsed_ticks;
  } else {
    // the loop itself stalled, and the device still reports: the force fades in again
    if (silent_ticks_ + elapsed_ticks - 1 > silent_limit_ticks_) after_stall_ = true;
    silent_ticks_ = 0;
  }
}

// in FAULT: returns false when the fault ends with this tick
bool ForceGate::staysInFault(const TipSample& tip, bool fresh, double handle_speed_mps,
                             std::uint32_t condition) noexcept {
  // while the tip still jumps, the cause lasts; each place is compared with the previous one
  if (fresh) {
    bad_in_fault_ = judge(tip) != Fault::kNone || !(handle_speed_mps <= limits_.fault_speed_mps);
    have_good_ = isFinite(tip.p_WT_m);
    last_good_p_W_m_ = tip.p_WT_m;
    ticks_since_good_ = 0;
  }
  cause_lasts_ = cause_outside_ || bad_in_fault_ || (condition & kDeviceFaultFlags) != 0 ||
                 silent_ticks_ > silent_limit_ticks_;
  if (cause_lasts_) acknowledged_ = false;
  if (!fresh || !acknowledged_ || !outside_ || fade_ != 0.0) return true;
  // as after start-up: the state is cleared, the force fades in
  fault_ = Fault::kNone;
  acknowledged_ = false;
  after_stall_ = false;
  rejected_ticks_ = 0;
  held_ = {};
  return false;
}

bool ForceGate::admit(const TipSample& tip, bool fresh, double handle_speed_mps, std::int64_t elapsed_ticks,
                      std::uint32_t condition) noexcept {
  flags_ = 0;
  admitted_ = false;
  ticks_since_good_ += elapsed_ticks;
  spendMissed(elapsed_ticks - 1);
  // ticks missed before a ramp begins do not count for it; a ramp from outside begins here
  const bool begins = fault_ != Fault::kNone ? fade_ == 1.0 : !holding_ && !after_stall_;
  holding_ = (condition & kDeviceHoldFlags) != 0;
  elapsed_ticks_ = begins ? 1 : elapsed_ticks;
  noteSilence(fresh, elapsed_ticks, condition);
  const bool in_fault = fault_ != Fault::kNone && staysInFault(tip, fresh, handle_speed_mps, condition);
  cause_outside_ = false;
  if (in_fault) return false;

  // the device's own report has immediate effect
  if (const Fault said = faultSaid(condition); said != Fault::kNone) {
    raise(said);
    return false;
  }
  if (!fresh) {
    if (silent_ticks_ > silent_limit_ticks_) raise(Fault::kDeviceSilent);
    return false;
  }
  if (const Fault found = judge(tip); found != Fault::kNone) {
    flags_ |= kGateSampleRejected;
    rejected_ticks_ += elapsed_ticks;
    if (rejected_ticks_ > kHoldTicks) raise(found);
    return false;
  }
  rejected_ticks_ = 0;
  ticks_since_good_ = 0;
  have_good_ = true;
  last_good_p_W_m_ = tip.p_WT_m;
  if (!(handle_speed_mps <= limits_.fault_speed_mps)) {
    raise(Fault::kDeviceTooFast);
    return false;
  }
  admitted_ = true;
  return true;
}

// the share fades out by time, so that missed ticks do not delay it
double ForceGate::lowered(double share) const noexcept {
  const double next = share - fade_out_step_ * static_cast<double>(std::max<std::int64_t>(1, elapsed_ticks_));
  return next > 1e-9 ? next : 0.0;
}

// fade: the wanted force comes slowly at the start; a hold removes it and fades it in again
void ForceGate::changeShare() noexcept {
  if (holding_ || after_stall_) {
    fade_ = lowered(fade_);
    if (fade_ == 0.0) after_stall_ = false;
    flags_ |= kGateStartRamp;
  } else if (fade_ < 1.0) {
    flags_ |= kGateStartRamp;
    fade_ = std::min(1.0, fade_ + fade_in_step_);
  }
}

GuardedWrench ForceGate::guard(const Wrench& wanted) noexcept {
  if (admitted_) {
    if (isFinite(wanted))
      held_ = wanted;
    else
      raise(Fault::kForceNotFinite);
  }

  // fault: the force falls linearly to zero
  const double share_before = fade_;
  Wrench next;
  if (fault_ != Fault::kNone) {
    flags_ |= kGateFaulted;
    fade_ = lowered(fade_);
    next = scaled(at_fault_, fade_);
  } else {
    changeShare();
    next = scaled(held_, fade_);
  }

  // peak, thermal budget, slew
  const bool peak_force = limitMagnitude(next.force_N, limits_.peak_force_N);
  const bool peak_torque = limitMagnitude(next.torque_Nm, limits_.peak_torque_Nm);
  if (peak_force || peak_torque) flags_ |= kGatePeakLimited;
  const double force_before = norm(next.force_N), torque_before = norm(next.torque_Nm);
  const bool hot_force = limitMagnitude(next.force_N, force_budget_.allowed(force_before));
  const bool hot_torque = limitMagnitude(next.torque_Nm, torque_budget_.allowed(torque_before));
  thermal_scale_ = 1.0;
  if (hot_force || hot_torque) {
    flags_ |= kGateThermalLimited;
    if (hot_force) thermal_scale_ = norm(next.force_N) / force_before;
    if (hot_torque) thermal_scale_ = std::min(thermal_scale_, norm(next.torque_Nm) / torque_before);
  }
  // where missed ticks count for a ramp, the share takes its force with it; slew limits what else changes
  const bool falls_late = fade_ < share_before && elapsed_ticks_ > 1;
  const Wrench from = falls_late ? scaled(out_, fade_ / share_before) : out_;
  const bool slew_force = limitChange(next.force_N, from.force_N, slew_force_N_);
  const bool slew_torque = limitChange(next.torque_Nm, from.torque_Nm, slew_torque_Nm_);
  if (slew_force || slew_torque) flags_ |= kGateSlewLimited;

  out_ = next;
  force_budget_.spend(norm(out_.force_N));
  torque_budget_.spend(norm(out_.torque_Nm));
  return GuardedWrench(out_);
}

// ---- thermal budget ----

namespace {

constexpr double kThermalWindow_s = 10;
constexpr double kBucket_s = 0.1;
constexpr double kThermalRecovery_s = 1;  // from zero to the peak, when the motors have cooled

}  // namespace

ThermalBudget::ThermalBudget(double peak, double continuous, double period_s) noexcept
    : peak_(peak),
      budget_(continuous * continuous * kThermalWindow_s),
      period_s_(period_s),
      recovery_(peak * period_s / kThermalRecovery_s),
      allowed_(peak),
      // rounded up, so that the buckets cover the whole window at any rate
      ticks_per_bucket_(static_cast<std::int64_t>(std::ceil(kBucket_s / period_s - 1e-6))) {}

double ThermalBudget::allowed(double wanted) noexcept {
  const double before = allowed_;
  allowed_ = std::min(limitNow(wanted), before + recovery_);
  return allowed_;
}

double ThermalBudget::limitNow(double wanted) const noexcept {
  if (budget_ <= 0) return 0.0;
  // the bucket that has left the window is given back tick by tick: the user would feel a step
  const double progress = static_cast<double>(ticks_in_bucket_) / static_cast<double>(ticks_per_bucket_);
  const double leaving = bucket_[(current_ + 1) % kBuckets];
  const double left = budget_ - (whole_ + bucket_[current_] + (1.0 - progress) * leaving);
  // the remaining budget, spread over a whole window, is enough: nearly always
  if (wanted * wanted * kThermalWindow_s <= left) return peak_;

  // the magnitude that can be held forever from now on: until the bucket `back` leaves the window, it and all
  // younger buckets count
  const double bucket_s = static_cast<double>(ticks_per_bucket_) * period_s_;
  double counted = 0, held_squared = peak_ * peak_;
  for (std::size_t back = 0; back < kBuckets - 1; ++back) {
    counted += bucket_[(current_ + kBuckets - back) % kBuckets];
    const double age_s = back == 0 ? 0.0 : (static_cast<double>(back) - 1 + progress) * bucket_s;
    const double until_s = kThermalWindow_s - age_s;
    if (until_s <= 0) break;
    held_squared = std::min(held_squared, (budget_ - counted) / until_s);
  }
  held_squared = std::max(0.0, held_squared);
  // a greater magnitude is allowed for a while: the colder the motors, the greater
  const double cold = std::max(0.0, left / budget_);
  return std::sqrt(held_squared + (peak_ * peak_ - held_squared) * (cold * cold * cold));
}

void ThermalBudget::spend(double magnitude) noexcept {
  bucket_[current_] += magnitude * magnitude * period_s_;
  if (++ticks_in_bucket_ < ticks_per_bucket_) return;
  ticks_in_bucket_ = 0;
  current_ = (current_ + 1) % kBuckets;
  bucket_[current_] = 0;
  // sum again, so that rounding errors do not accumulate for hours; all but the current bucket and the
  // leaving bucket
  whole_ = 0;
  for (std::size_t i = 2; i < kBuckets; ++i) whole_ += bucket_[(current_ + i) % kBuckets];
}

const char* faultText(Fault fault) {
  switch (fault) {
    case Fault::kNone:
      return "no fault";
    case Fault::kSampleNotFinite:
      return "the device reported a position that is not a number";
    case Fault::kTipTooFast:
      return "the needle's tip jumped faster than 5 m/s";
    case Fault::kDeviceTooFast:
      return "the device moved faster than it may";
    case Fault::kDeviceSilent:
      return "the device stopped reporting its position";
    case Fault::kForceNotFinite:
      return "the computed force was not a number";
    case Fault::kOrientationInvalid:
      return "the device reported an orientation that is no rotation";
    case Fault::kEmergencyStop:
      return "the emergency stop is pressed";
    case Fault::kDeviceLost:
      return "the device is unplugged, or its link is broken";
    case Fault::kDeviceOverheated:
      return "the device's motors are too hot";
    case Fault::kDeviceTrouble:
      return "the device reported an error";
    case Fault::kProgramTrouble:
      return "another part of the program died";
  }
  return "unknown fault";
}

}  // namespace needlelab
