#include "common/haptics/gate/force_gate.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace needlelab {
namespace {

constexpr double kFadeIn_s = 0.2;    // start-up
constexpr double kFadeOut_s = 0.02;  // a fault removes the force within this time
constexpr double kSlewForce_N_per_s = 2000;
constexpr double kSlewTorque_Nm_per_s = 100;
constexpr double kLimitRise_per_s = 5;
// if the share rises here, the hand gains at most half of force times distance: 0.1 mJ for 10 mm or 0.1 rad
constexpr double kNearZero_N = 0.02, kNearZero_Nm = 0.002;
constexpr double kMaxTipSpeed_mps = 5;
constexpr std::int64_t kHoldTicks = 5;  // number of rejected samples for which the last force is held
constexpr double kWatchdog_s = 0.02;    // silence of the device after which the force is removed

// the share of a wrench that keeps both parts within their limits
double shareWithin(const Wrench& w, double max_N, double max_Nm) noexcept {
  double share = 1;
  if (const double size = norm(w.force_N); size > max_N) share = max_N / size;
  if (const double size = norm(w.torque_Nm); size > max_Nm) share = std::min(share, max_Nm / size);
  return share;
}

bool isFinite(const Wrench& w) noexcept {
  return needlelab::isFinite(w.force_N) && needlelab::isFinite(w.torque_Nm);
}

Wrench scaled(const Wrench& w, double s) noexcept {
  return {w.force_N * s, w.torque_Nm * s};
}

// the fault that the device itself reports; a person's action takes precedence
Fault faultOfCondition(std::uint32_t condition) noexcept {
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
      limit_rise_step_(std::min(1.0, kLimitRise_per_s * period_s_)),
      slew_force_N_(kSlewForce_N_per_s * period_s_),
      slew_torque_Nm_(kSlewTorque_Nm_per_s * period_s_),
      silent_limit_ticks_(
          std::max<std::int64_t>(kHoldTicks, static_cast<std::int64_t>(kWatchdog_s * rate_hz + 0.5))),
      force_budget_(limits.peak_force_N, limits.continuous_force_N, period_s_),
      torque_budget_(limits.peak_torque_Nm, limits.continuous_torque_Nm, period_s_) {
  assert(rate_hz > 0);
  assert(fade_in_step_ > 0 && fade_out_step_ > 0 && fade_out_step_ <= 1);
}

Fault ForceGate::judge(const TipSample& tip) const noexcept {
  if (!isFinite(tip.p_WT_m) || !needlelab::isFinite(tip.q_WT)) return Fault::kSampleNotFinite;
  if (std::fabs(std::sqrt(dot(tip.q_WT, tip.q_WT)) - 1.0) > 1e-3) return Fault::kOrientationInvalid;
  const double reach_m = kMaxTipSpeed_mps * period_s_ * static_cast<double>(ticks_since_good_);
  if (have_good_ && norm(tip.p_WT_m - last_good_p_W_m_) > reach_m) return Fault::kTipTooFast;
  return Fault::kNone;
}

void ForceGate::raise(Fault fault) noexcept {
  assert(fault != Fault::kNone);
  assert(isFinite(out_) && "the gate lets nothing else through");
  fault_ = fault;
  at_fault_ = out_;
  limit_share_ = 1;  // `at_fault_` already excludes what was taken before
  limited_by_ = 0;
  fade_ = 1.0;
  elapsed_ticks_ = 1;  // earlier missed ticks do not count for the ramp
  acknowledged_ = false;
  outside_ = false;
  ++faults_raised_;
  cause_lasts_ = true;
  bad_in_fault_ = false;
  after_stall_ = false;
}

void ForceGate::raiseFromOutside(Fault fault) noexcept {
  assert(fault != Fault::kNone);
  cause_outside_ = true;
  if (fault_ == Fault::kNone) raise(fault);
}

// the motors also warmed up during missed ticks: the device kept rendering the last force
void ForceGate::spendMissed(std::int64_t ticks) noexcept {
  constexpr std::int64_t kMost = 20'000;  // 2 s at 10 kHz: no device keeps rendering on its own for longer
  const double force_N = norm(out_.force_N), torque_Nm = norm(out_.torque_Nm);
  for (std::int64_t i = std::min(ticks, kMost); i > 0; --i) {
    force_budget_.spend(force_N);
    torque_budget_.spend(torque_Nm);
  }
}

// the time since the device's last update; ticks that the loop itself missed count, too
void ForceGate::noteSilence(bool fresh, std::int64_t elapsed_ticks, std::uint32_t condition) noexcept {
  if ((condition & kDeviceNotReady) != 0) {
    silent_ticks_ = 0;  // the device reports why it is silent, and renders no force
  } else if (!fresh) {
    silent_ticks_ += elapsed_ticks;
  } else {
    // the loop itself stalled while the device kept reporting: the force fades in again
    if (silent_ticks_ + elapsed_ticks - 1 > silent_limit_ticks_) after_stall_ = true;
    silent_ticks_ = 0;
  }
}

// in FAULT: returns false when the fault ends with this tick
bool ForceGate::staysInFault(const TipSample& tip, bool fresh, double handle_speed_mps,
                             std::uint32_t condition) noexcept {
  assert(fault_ != Fault::kNone);
  // while the tip still jumps, the cause persists; each place is compared with the previous one
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
  // as after start-up: clear the state, and let the force fade in
  fault_ = Fault::kNone;
  acknowledged_ = false;
  after_stall_ = false;
  rejected_ticks_ = 0;
  held_ = {};
  return false;
}

bool ForceGate::admit(const TipSample& tip, bool fresh, double handle_speed_mps, std::int64_t elapsed_ticks,
                      std::uint32_t condition) noexcept {
  assert(elapsed_ticks >= 0 && ticks_since_good_ >= 0 && rejected_ticks_ >= 0 && silent_ticks_ >= 0);
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
  if (const Fault said = faultOfCondition(condition); said != Fault::kNone) {
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
  assert(fault_ == Fault::kNone);
  admitted_ = true;
  return true;
}

// the share fades out by time, so that missed ticks do not delay it
double ForceGate::lowered(double share) const noexcept {
  assert(share >= 0 && share <= 1);
  const double next = share - fade_out_step_ * static_cast<double>(std::max<std::int64_t>(1, elapsed_ticks_));
  return next > 1e-9 ? next : 0.0;
}

// fade: the wanted force comes in slowly at the start; a hold removes it and later fades it in again
void ForceGate::changeShare() noexcept {
  if (holding_ || after_stall_) {
    fade_ = lowered(fade_);
    if (fade_ == 0.0) after_stall_ = false;
    flags_ |= kGateStartRamp;
  } else if (fade_ < 1.0) {
    flags_ |= kGateStartRamp;
    fade_ = std::min(1.0, fade_ + fade_in_step_);
  }
  assert(fade_ >= 0 && fade_ <= 1);
}

void ForceGate::lowerLimitShare(double share, std::uint32_t why) noexcept {
  if (share >= 1) return;
  limit_share_ *= share;
  limited_by_ |= why;
}

// peak and thermal budget: one share for force and torque. With V the energy of the springs that the hand
// leans on, a cycle of the hand gains ∫ V ds from a share s; so s rises only where V is almost zero.
Wrench ForceGate::withinLimits(Wrench wanted) noexcept {
  if (std::min(limits_.peak_force_N, limits_.continuous_force_N) <= 0) wanted.force_N = {};
  if (std::min(limits_.peak_torque_Nm, limits_.continuous_torque_Nm) <= 0) wanted.torque_Nm = {};
  if (norm(wanted.force_N) <= kNearZero_N && norm(wanted.torque_Nm) <= kNearZero_Nm) {
    limit_share_ = std::min(1.0, limit_share_ + limit_rise_step_);
    if (limit_share_ == 1.0) limited_by_ = 0;
  }
  lowerLimitShare(shareWithin(scaled(wanted, limit_share_), limits_.peak_force_N, limits_.peak_torque_Nm),
                  kGatePeakLimited);
  const Wrench within_peak = scaled(wanted, limit_share_);
  const double allowed_N = force_budget_.allowed(norm(within_peak.force_N));
  const double allowed_Nm = torque_budget_.allowed(norm(within_peak.torque_Nm));
  lowerLimitShare(shareWithin(within_peak, allowed_N, allowed_Nm), kGateThermalLimited);
  assert(limit_share_ <= 1 && (limit_share_ < 1) == (limited_by_ != 0));
  flags_ |= limited_by_;
  return scaled(wanted, limit_share_);
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

  next = withinLimits(next);

  // if missed ticks count for a ramp, the share lowers the force at once; slew limits all other changes
  const bool falls_late = fade_ < share_before && elapsed_ticks_ > 1;
  const Wrench from = falls_late ? scaled(out_, fade_ / share_before) : out_;
  const Wrench change{next.force_N - from.force_N, next.torque_Nm - from.torque_Nm};
  if (const double way = shareWithin(change, slew_force_N_, slew_torque_Nm_); way < 1) {
    flags_ |= kGateSlewLimited;
    next = {from.force_N + change.force_N * way, from.torque_Nm + change.torque_Nm * way};
  }

  assert(isFinite(next));
  assert(norm(next.force_N) <= std::max(0.0, limits_.peak_force_N) * (1 + 1e-9));
  assert(norm(next.torque_Nm) <= std::max(0.0, limits_.peak_torque_Nm) * (1 + 1e-9));
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
      ticks_per_bucket_(static_cast<std::int64_t>(std::ceil(kBucket_s / period_s - 1e-6))) {
  assert(period_s > 0 && ticks_per_bucket_ > 0);
}

double ThermalBudget::allowed(double wanted) noexcept {
  const double before = allowed_;
  allowed_ = std::min(limitNow(wanted), before + recovery_);
  assert(wanted >= 0);
  return allowed_;
}

double ThermalBudget::limitNow(double wanted) const noexcept {
  if (budget_ <= 0) return 0.0;
  // give back the bucket that left the window tick by tick, because the user would feel a step
  const double progress = static_cast<double>(ticks_in_bucket_) / static_cast<double>(ticks_per_bucket_);
  const double leaving = bucket_[(current_ + 1) % kBuckets];
  const double left = budget_ - (whole_ + bucket_[current_] + (1.0 - progress) * leaving);
  // usually the remaining budget, spread over a whole window, is enough
  if (wanted * wanted * kThermalWindow_s <= left) return peak_;

  // the magnitude that can be held for ever from now on: until the bucket `back` leaves the window, it and
  // all younger buckets count
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
  // a greater magnitude is allowed for a while, the more the colder the motors are
  const double cold = std::max(0.0, left / budget_);
  return std::sqrt(held_squared + (peak_ * peak_ - held_squared) * (cold * cold * cold));
}

void ThermalBudget::spend(double magnitude) noexcept {
  assert(magnitude >= 0 && std::isfinite(magnitude));
  assert(current_ < kBuckets && ticks_in_bucket_ < ticks_per_bucket_);
  bucket_[current_] += magnitude * magnitude * period_s_;
  if (++ticks_in_bucket_ < ticks_per_bucket_) return;
  ticks_in_bucket_ = 0;
  current_ = (current_ + 1) % kBuckets;
  bucket_[current_] = 0;
  // sum again, so that rounding errors do not accumulate for hours; omit the current and the leaving bucket
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
      return "the device reported an invalid orientation (not a rotation)";
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
