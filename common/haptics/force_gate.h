/// The one gate between engine and device (FORCE_MODEL.md, "Gate"), on every path: sample checks before the
/// engine, force limits after it.
#pragma once

#include <array>
#include <cstdint>

#include "common/haptics/engine.h"

namespace needlelab {

/// What the motors may still take: the energy ∫|f|² of any 10 s stays at or below 10 s times the continuous
/// limit squared. A magnitude up to 0.98 of the continuous limit is never cut; a greater one is
/// let down, as the budget goes, to what can be held for good.
class ThermalBudget {
 public:
  ThermalBudget(double peak, double continuous, double period_s) noexcept;
  /// Largest magnitude allowed in this tick, when `wanted` is asked for. Once a tick.
  [[nodiscard]] double allowed(double wanted) noexcept;
  /// Counts the magnitude that was given to the device in this tick.
  void spend(double magnitude) noexcept;

 private:
  [[nodiscard]] double limitNow(double wanted) const noexcept;

  /// 100 ms each: the current one, 100 that the window reaches into, and one that has just left it.
  static constexpr std::size_t kBuckets = 102;
  double peak_, budget_, period_s_;
  double recovery_, allowed_;  ///< the allowed magnitude rises by at most so much a tick
  std::array<double, kBuckets> bucket_{};
  std::size_t current_ = 0;
  std::int64_t ticks_in_bucket_ = 0, ticks_per_bucket_;
  double whole_ = 0;  ///< sum of the 100
};

/// What a device can render and stand, as data of its backend.
struct DeviceLimits {
  double peak_force_N = 10, continuous_force_N = 3;
  double peak_torque_Nm = 0.8, continuous_torque_Nm = 0.2;
  double max_stiffness_N_per_m = 1000, max_rotational_stiffness_Nm_per_rad = 4;
  double fault_speed_mps = 1.6;  ///< the device's own fault threshold
  double apparent_mass_kg = 0.35;
  double damping_Ns_per_m = 1.7;
};

/// Why force was taken away. Values are stored in recordings: append only.
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
  kGatePeakLimited = 1u << 17,
  kGateThermalLimited = 1u << 18,
  kGateSlewLimited = 1u << 19,
  kGateStartRamp = 1u << 20,
  kGateFaulted = 1u << 21,
};

class ForceGate;

/// A wrench that went through the gate: the only thing that a device accepts. At the handle, in W.
class GuardedWrench {
 public:
  GuardedWrench() = default;  ///< zero
  [[nodiscard]] const Wrench& wrench() const { return wrench_; }

 private:
  friend class ForceGate;
  explicit GuardedWrench(const Wrench& wrench) : wrench_(wrench) {}
  Wrench wrench_;
};

/// Two ways to lose force, beside the limits:
///
/// - A FAULT: the force goes away in a straight line within 20 ms. It comes back, faded in over 200 ms, only
///   when the cause is over, a person acknowledged it after that, and the tip is outside the tissue.
/// - A hold (kDeviceHoldFlags: no hand, no power, not ready): the rendered share of the force falls to zero
///   within 20 ms, stays there, and rises over 200 ms afterwards. Samples are admitted and stepped all
///   the while: the needle is where it is, and what fades in is the force of that place. So from tick to tick
///   the force changes by at most 1/20 of what is wanted, beside the change of what is wanted. The same
///   happens after a stall of the loop itself (more missed ticks in a row than the watchdog's limit).
///
/// Thread: the haptic thread only (acknowledge may be asked for by its owner between ticks). Real-time safe,
/// no clock: it counts ticks.
class ForceGate {
 public:
  ForceGate(const DeviceLimits& limits, double rate_hz);

  /// Before the engine: is this sample good? `fresh` is false when the device gave no update in this tick.
  /// Returns false when the tick must not be stepped (bad sample, or in FAULT).
  /// `tip` is the tip's pose, `handle_speed_mps` the device's own reported speed (0 when it reports none),
  /// `elapsed_ticks` how many periods passed since the last call: 1, or more after missed ticks.
  /// A sample that comes after missed or rejected ones is judged by its distance over all of the elapsed
  /// time. `condition`: DeviceFlag bits of this tick, which count without a fresh sample, too. A device that
  /// says kDeviceNotReady may be silent: it has no force.
  bool admit(const TipSample& tip, bool fresh, double handle_speed_mps, std::int64_t elapsed_ticks = 1,
             std::uint32_t condition = 0) noexcept;

  /// After the engine (or without it, when `admit` said no): the wrench for the device in this tick.
  /// `wanted` is at the handle, in W; it is ignored in a tick that was not admitted.
  GuardedWrench guard(const Wrench& wanted) noexcept;

  /// A FAULT whose cause the gate cannot see itself, such as a crash of the view. Before `admit`, in each
  /// tick in which the cause lasts; in a FAULT of another kind that one's name stays.
  void raiseFromOutside(Fault fault) noexcept;
  /// A person has seen the fault. It does not count while the cause lasts, so that nothing starts by itself
  /// when an emergency stop is let out; it may come before the tip is outside.
  void acknowledge() noexcept { acknowledged_ = fault_ != Fault::kNone; }
  /// Tells the gate whether the tip is outside the tissue (any δ ≤ 0): in FAULT before `admit`, with the
  /// sample that `admit` gets, so that the first tick of a new start is outside.
  void noteOutside(bool outside) noexcept { outside_ = outside; }

  [[nodiscard]] Fault fault() const noexcept { return fault_; }
  /// How often a fault was raised, over all of the gate's life.
  [[nodiscard]] std::uint64_t faultsRaised() const noexcept { return faults_raised_; }
  /// In FAULT: the cause was present in the last tick, so that an acknowledgement does not count yet.
  [[nodiscard]] bool causeLasts() const noexcept { return cause_lasts_; }
  /// In FAULT: it is acknowledged and waits for the tip to be outside.
  [[nodiscard]] bool acknowledged() const noexcept { return acknowledged_; }
  [[nodiscard]] std::uint32_t flags() const noexcept { return flags_; }  ///< GateFlag bits of the last tick
  [[nodiscard]] double thermalScale() const noexcept { return thermal_scale_; }

 private:
  void raise(Fault fault) noexcept;
  [[nodiscard]] Fault judge(const TipSample& tip) const noexcept;
  bool staysInFault(const TipSample& tip, bool fresh, double handle_speed_mps,
                    std::uint32_t condition) noexcept;
  void noteSilence(bool fresh, std::int64_t elapsed_ticks, std::uint32_t condition) noexcept;
  void spendMissed(std::int64_t ticks) noexcept;
  void changeShare() noexcept;
  [[nodiscard]] double lowered(double share) const noexcept;

  DeviceLimits limits_;
  double period_s_;
  double fade_in_step_, fade_out_step_;   ///< share of the force gained or lost in a tick
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
  double thermal_scale_ = 1;
  std::uint32_t flags_ = 0;
};

}  // namespace needlelab
