/// The one gate between engine and device (FORCE_MODEL.md, "Gate"), on every path: sample checks before the
/// engine, force limits after it.
#pragma once

#include <array>
#include <cstdint>

#include "common/haptics/engine.h"

namespace needlelab {

/// The thermal budget of the motors: the energy ∫|f|² of any 10 s stays at or below 10 s times the continuous
/// limit squared. A magnitude up to 0.98 of the continuous limit is never reduced; a greater magnitude is
/// lowered, as the budget runs out, to a level that can be held for ever.
class ThermalBudget {
 public:
  ThermalBudget(double peak, double continuous, double period_s) noexcept;
  /// Returns the largest magnitude allowed in this tick for the requested `wanted`. Call once per tick.
  [[nodiscard]] double allowed(double wanted) noexcept;
  /// Records the magnitude sent to the device in this tick.
  void spend(double magnitude) noexcept;

 private:
  [[nodiscard]] double limitNow(double wanted) const noexcept;

  /// Slots of 100 ms: the current slot, the 100 slots in the window, and the slot that has just left it.
  static constexpr std::size_t kBuckets = 102;
  double peak_, budget_, period_s_;
  double recovery_, allowed_;  ///< `recovery_`: greatest rise of the allowed magnitude per tick
  std::array<double, kBuckets> bucket_{};
  std::size_t current_ = 0;
  std::int64_t ticks_in_bucket_ = 0, ticks_per_bucket_;
  double whole_ = 0;  ///< sum of the 100 slots
};

/// The limits of a device, provided by its backend.
struct DeviceLimits {
  double peak_force_N = 10, continuous_force_N = 3;
  double peak_torque_Nm = 0.8, continuous_torque_Nm = 0.2;
  double max_stiffness_N_per_m = 1000, max_rotational_stiffness_Nm_per_rad = 4;
  double fault_speed_mps = 1.6;  ///< the device's own fault threshold
  double apparent_mass_kg = 0.35;
  double damping_Ns_per_m = 1.7;
};

/// The condition that a device reports in each tick with its pose: the gate acts on it, and the recording
/// keeps it. Bits 22-30 of a recorded sample's flags, next to StepFlag and GateFlag. Append only.
enum DeviceFlag : std::uint32_t {
  kDeviceEmergencyStop = 1u << 22,  ///< fault: the emergency stop is pressed
  kDeviceReleased = 1u << 23,       ///< hold: the dead-man sensor detects no hand
  kDevicePowerOff = 1u << 24,       ///< hold: the motors have no power
  kDeviceOverheated = 1u << 25,     ///< fault
  kDeviceSaturated = 1u << 26,  ///< reported and counted: the device renders less than the requested force
  kDeviceOverrun = 1u << 27,    ///< reported and counted: the device could not keep the rate
  kDeviceLost = 1u << 28,       ///< fault: unplugged, or its link is broken
  kDeviceTrouble = 1u << 29,    ///< fault: another error; `Device::status` has the text
  kDeviceNotReady = 1u << 30,   ///< hold: the device is homing or loads its firmware
};

/// All device flags.
inline constexpr std::uint32_t kDeviceFlags = 0x7FC0'0000u;
/// Faults: the force fades out within 20 ms and returns only after the fault is over and acknowledged and the
/// tip is outside.
inline constexpr std::uint32_t kDeviceFaultFlags =
    kDeviceEmergencyStop | kDeviceOverheated | kDeviceLost | kDeviceTrouble;
/// Holds: the force fades out within 20 ms and fades in over 200 ms when the flag clears, without
/// acknowledgement.
inline constexpr std::uint32_t kDeviceHoldFlags = kDeviceReleased | kDevicePowerOff | kDeviceNotReady;

/// The reason for a loss of force. Values are stored in recordings: append only.
enum class Fault : std::uint8_t {
  kNone = 0,
  kSampleNotFinite = 1,
  kTipTooFast = 2,     ///< the tip jumped: over 5 m/s since the last good sample
  kDeviceTooFast = 3,  ///< above the device's own threshold
  kDeviceSilent = 4,   ///< watchdog: no update from the device
  kForceNotFinite = 5,
  kOrientationInvalid = 6,  ///< the reported quaternion is not a rotation: | |q| − 1 | > 1e-3
  kEmergencyStop = 7,       ///< pressed at the device
  kDeviceLost = 8,          ///< unplugged, or its link is broken
  kDeviceOverheated = 9,
  kDeviceTrouble = 10,   ///< the device reported another error
  kProgramTrouble = 11,  ///< another part of the program (the view) died
};
const char* faultText(Fault fault);

/// Bits that the gate sets per tick; counted by the station and stored with the sample.
enum GateFlag : std::uint32_t {
  kGateSampleRejected = 1u << 16,
  kGatePeakLimited = 1u << 17,     ///< lowered by the peak limit, in this tick or since the share was 1
  kGateThermalLimited = 1u << 18,  ///< likewise by the thermal budget
  kGateSlewLimited = 1u << 19,
  kGateStartRamp = 1u << 20,
  kGateFaulted = 1u << 21,
};

class ForceGate;

/// A wrench that has passed the gate; devices accept no other type. At the handle, in W.
class GuardedWrench {
 public:
  GuardedWrench() = default;  ///< zero
  [[nodiscard]] const Wrench& wrench() const { return wrench_; }

 private:
  friend class ForceGate;
  explicit GuardedWrench(const Wrench& wrench) : wrench_(wrench) {}
  Wrench wrench_;
};

/// Force and torque are one force at the needle's tip, so every limit shortens both by one share:
///
/// - Peak and thermal budget lower one share, which the gate remembers. It falls at once, and rises by 5 a
///   second only while the wanted wrench is within 0.02 N and 2 mN·m. In contact it never rises, because a
///   spring whose share rises while a hand leans on it gives energy to the hand.
/// - Slew: force and torque go the same fraction of the way from the last wrench to the next one.
/// - A part with a limit of zero (the torque of a device without torque) is dropped and does not affect the
///   share.
///
/// Besides the limits, the force is lost in two ways:
///
/// - A FAULT: the force falls linearly to zero within 20 ms. It fades in again over 200 ms only when the
///   cause is over, a person has then acknowledged the fault, and the tip is outside the tissue.
/// - A hold (kDeviceHoldFlags: no hand, no power, not ready): the rendered share of the force falls to zero
///   within 20 ms, stays there, and rises over 200 ms afterwards. Samples are still admitted and stepped: the
///   needle keeps its true position, and the force of that position fades in. From tick to tick the force
///   therefore changes by at most 1/20 of the wanted force, plus the change of the wanted force. The same
///   happens after a stall of the loop itself (more missed ticks in a row than the watchdog's limit).
///
/// Missed ticks count for both ramps down: the next tick removes their part of the force at once.
///
/// Thread: the haptic thread only (its owner may call acknowledge between ticks). Real-time safe; uses no
/// clock: it counts ticks.
class ForceGate {
 public:
  ForceGate(const DeviceLimits& limits, double rate_hz);

  /// Checks a sample before the engine. `fresh` is false when the device gave no update in this tick. Returns
  /// false when the tick must not be stepped (bad sample, or in FAULT). `tip` is the tip's pose,
  /// `handle_speed_mps` the device's own reported speed (0 when it reports none), `elapsed_ticks` the number
  /// of periods since the last call: 1, or more after missed ticks. After missed or rejected samples, a
  /// sample's distance is judged over the whole elapsed time. `condition`: DeviceFlag bits of this tick; they
  /// count even without a fresh sample. A device that reports kDeviceNotReady may be silent: it renders no
  /// force.
  bool admit(const TipSample& tip, bool fresh, double handle_speed_mps, std::int64_t elapsed_ticks = 1,
             std::uint32_t condition = 0) noexcept;

  /// Returns the wrench for the device in this tick. Call it after the engine, or without the engine when
  /// `admit` returned false. `wanted` is at the handle, in W; it is ignored in a tick that was not admitted.
  GuardedWrench guard(const Wrench& wanted) noexcept;

  /// Raises a FAULT with a cause outside the gate, such as a crash of the view. Call it before `admit`, in
  /// each tick while the cause lasts; a FAULT of another kind that is already active keeps its name.
  void raiseFromOutside(Fault fault) noexcept;
  /// A person acknowledges the fault. It has no effect before a tick without the cause (`causeLasts`), so
  /// that nothing starts by itself when an emergency stop is released; it may come before the tip is outside.
  void acknowledge() noexcept { acknowledged_ = fault_ != Fault::kNone && !cause_lasts_; }
  /// Tells the gate whether the tip is outside the tissue (any δ ≤ 0): in FAULT, call it before `admit` with
  /// the same sample, so that the first tick after the fault is outside.
  void noteOutside(bool outside) noexcept { outside_ = outside; }

  [[nodiscard]] Fault fault() const noexcept { return fault_; }
  /// The number of faults raised during the gate's lifetime.
  [[nodiscard]] std::uint64_t faultsRaised() const noexcept { return faults_raised_; }
  /// In FAULT: the cause was present in the last tick, so an acknowledgement does not count yet.
  [[nodiscard]] bool causeLasts() const noexcept { return cause_lasts_; }
  /// In FAULT: the fault is acknowledged, and the gate waits for the tip to be outside.
  [[nodiscard]] bool acknowledged() const noexcept { return acknowledged_; }
  [[nodiscard]] std::uint32_t flags() const noexcept { return flags_; }  ///< GateFlag bits of the last tick
  /// The share that peak limit and thermal budget leave of the wanted wrench, [0, 1]. Below 1 the flags say
  /// which of them lowered it.
  [[nodiscard]] double limitShare() const noexcept { return limit_share_; }

 private:
  void raise(Fault fault) noexcept;
  [[nodiscard]] Fault judge(const TipSample& tip) const noexcept;
  bool staysInFault(const TipSample& tip, bool fresh, double handle_speed_mps,
                    std::uint32_t condition) noexcept;
  void noteSilence(bool fresh, std::int64_t elapsed_ticks, std::uint32_t condition) noexcept;
  void spendMissed(std::int64_t ticks) noexcept;
  void changeShare() noexcept;
  [[nodiscard]] Wrench withinLimits(Wrench wanted) noexcept;
  void lowerLimitShare(double share, std::uint32_t why) noexcept;
  [[nodiscard]] double lowered(double share) const noexcept;

  DeviceLimits limits_;
  double period_s_;
  double fade_in_step_, fade_out_step_;   ///< share of the force gained or lost in a tick
  double limit_rise_step_;                ///< greatest rise of `limit_share_` in a tick
  double slew_force_N_, slew_torque_Nm_;  ///< largest change in a tick
  std::int64_t silent_limit_ticks_;
  ThermalBudget force_budget_, torque_budget_;

  Vec3 last_good_p_W_m_;
  bool have_good_ = false;
  std::int64_t ticks_since_good_ = 0, elapsed_ticks_ = 1;
  std::int64_t rejected_ticks_ = 0, silent_ticks_ = 0;
  bool admitted_ = false, acknowledged_ = false, outside_ = true;
  bool cause_lasts_ = false, cause_outside_ = false, bad_in_fault_ = false;
  bool holding_ = false;      ///< a hold flag in this tick
  bool after_stall_ = false;  ///< the share falls to zero before it rises again
  Fault fault_ = Fault::kNone;
  std::uint64_t faults_raised_ = 0;
  double fade_ = 0;  ///< 0-1
  Wrench held_, out_, at_fault_;
  double limit_share_ = 1;
  std::uint32_t limited_by_ = 0;  ///< GateFlag bits of the limits that lowered `limit_share_`; 0 while it is
                                  ///< 1
  std::uint32_t flags_ = 0;
};

}  // namespace needlelab
