/// A passivity observer and controller in front of the gate (FORCE_MODEL.md, "Passivity control"): it counts
/// the energy that the rendered wrench gives to the hand, including hold and delay, and gives no more than
/// was taken. Off unless a program asks for it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "common/haptics/geometry.h"

namespace needlelab {

struct PassivitySettings {
  std::uint32_t delay_ticks = 1;  ///< the wrench of tick k acts from tick k + delay on; at most kMaxDelay
  double lag_s = 0;               ///< time constant of the actuators' first-order lag, after the delay
  /// Damping of the device alone, which always loses energy. Underestimating it is safe; 0: not counted.
  double damping_Ns_per_m = 0, rotational_damping_Nms_per_rad = 0;
  double reserve_J = 20e-6;  ///< free energy in the tank at the beginning and while no wrench is wanted
  /// The tank's capacity beyond what the springs hold; energy that tissue took beyond both is lost. It pays
  /// for what a benign loop gives behind its delay, and is all that a bad one can give after a long
  /// insertion.
  double capacity_J = 5e-3;
  static constexpr std::uint32_t kMaxDelay = 15;
};

/// The whole state of a PassivityControl: plain data of fixed size; a copy is a snapshot.
struct PassivityState {
  static constexpr std::size_t kPoses = 8;      ///< ticks over which speed and damping are measured
  static constexpr std::size_t kWrenches = 32;  ///< wrenches kept; the newest is before `next_wrench`
  double level_J = 0;  ///< level of the tank: energy from the hand and the device's damping, less what the
                       ///< hand received
  double share = 1;    ///< share of the wrench that is rendered, [0, 1]
  std::array<Pose, kPoses> poses{};          ///< handle poses at the last fresh ticks, a ring
  std::array<Wrench, kWrenches> rendered{};  ///< wrenches as they act, averaged over their ticks
  Wrench acting{};                           ///< the wrench after the lag, at the end of the newest of those
                                             ///< ticks
  Wrench given{};                            ///< the wrench given to the device in the newest of those ticks
  std::uint32_t next_pose = 0, known_poses = 0, next_wrench = 0;
  std::uint32_t unseen_ticks = 0;  ///< ticks since the newest pose
  friend bool operator==(const PassivityState&, const PassivityState&) = default;
};
static_assert(std::is_trivially_copyable_v<PassivityState>);

/// Time-domain passivity (Hannaford and Ryu 2002) with an energy tank (Franken et al. 2011). The observer is
/// exact if a wrench is held for a tick and acts a known number of ticks late: its work is wrench × distance.
/// It counts what the gate let through, so a force that fades in or is derated counts as rendered. Behind a
/// first-order lag, a wrench that is held for a tick counts with its exact mean over the tick.
/// The controller reduces a wrench that gives energy, so that the tank empties no faster than exponentially
/// over a few ticks. It changes a force by at most kMostStep_N a tick, as long as the tank pays for that. A
/// sudden turn may overdraw the tank; until that debt is paid, only a wrench that takes energy is rendered.
/// This dissipator is never stronger than the force itself and never pushes on its own.
///
/// Thread: the haptic thread only. Real-time safe: no heap, lock, clock or exception. Same inputs, same bits.
class PassivityControl {
 public:
  static constexpr double kMostStep_N = 0.3;

  /// `rate_hz` > 0. A delay above kMaxDelay counts as kMaxDelay, negative numbers as 0.
  PassivityControl(const PassivitySettings& settings, double rate_hz) noexcept;

  /// Returns the wrench to hand to the gate. Call once per tick: with `fresh`, the handle's pose `X_WH` of
  /// this tick (finite, unit quaternion), the wrench at the handle that the engine wants, and what the
  /// springs behind it hold (heldEnergy_J); without it, nothing is observed, and `wanted` is returned with
  /// the last tick's share. `elapsed_ticks`: as for ForceGate::admit.
  [[nodiscard]] Wrench limited(const Pose& X_WH, bool fresh, const Wrench& wanted, double held_J,
                               std::int64_t elapsed_ticks = 1) noexcept;
  /// Call after the gate, with this tick's wrench for the device.
  void rendered(const Wrench& at_handle_W) noexcept;

  [[nodiscard]] const PassivityState& state() const noexcept { return state_; }

 private:
  struct Wish {
    double share;            // of the wrench, that empties the tank no faster than exponentially
    double power_W, free_J;  // of all of it; in the tank, less what is under way
  };
  void observe(const Pose& X_WH, double held_J) noexcept;
  [[nodiscard]] Wrench underWay() const noexcept;
  [[nodiscard]] Wish wish(const Wrench& wanted) const noexcept;
  [[nodiscard]] double nextShare(const Wrench& wanted) const noexcept;

  PassivitySettings settings_;
  double period_s_, horizon_s_;
  std::uint32_t speed_ticks_ = 1;
  double left_ = 0, mean_left_ = 0;  // share of a wrench step not yet acting behind the lag: at the tick's
                                     // end, and its mean over the tick
  PassivityState state_;
};

}  // namespace needlelab
