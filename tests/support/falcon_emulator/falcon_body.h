/// The mechanics of the emulated Falcon, with the hand that holds it.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "tests/support/falcon_emulator/delta_solver.h"
#include "tests/support/falcon_emulator/usb_peripheral.h"

namespace needlelab::test {

/// The hand's target for the grip, in F, `t` seconds after the path was set.
using HandPath = std::function<Eigen::Vector3d(double t)>;

/// A compliant hand: it pulls the grip to its path with a spring.
struct SoftHand {
  double mass_kg = 0.25;  ///< of grip and hand
  double stiffness_N_per_m = 300, damping_Ns_per_m = 5;
};

/// Thread: under the port's lock.
class FalconBody {
 public:
  FalconBody();

  /// The grip follows the path exactly, independent of the motors.
  void holdRigidly(HandPath path, TimePoint now);
  /// The grip moves under the forces on it.
  void holdSoftly(const SoftHand& hand, HandPath path, TimePoint now);

  /// Advances to `now`. Skips gaps of more than a second.
  void advance(TimePoint now);

  /// Motor values as in the packet. They hold until the next packet.
  void drive(const std::array<std::int16_t, 3>& motors) { motors_ = motors; }
  void lookForZero(bool look) { looking_ = look; }
  /// Simulates the electronics' power-on: the encoders count from the arms' current position.
  void resetEncoders();

  [[nodiscard]] std::array<std::int16_t, 3> encoders() const;
  [[nodiscard]] unsigned homed() const { return homed_; }  ///< bit i: leg i knows its zero
  [[nodiscard]] const Eigen::Vector3d& grip() const { return p_; }
  [[nodiscard]] Eigen::Vector3d thighs() const;
  /// The motors' force on the hand, in F.
  [[nodiscard]] Eigen::Vector3d force() const;

 private:
  void moveTo(const Eigen::Vector3d& p);
  [[nodiscard]] Eigen::Vector3d torques() const;

  AllLegs angles_;
  Eigen::Vector3d p_, v_;
  std::array<std::int16_t, 3> motors_{};
  bool looking_ = false, soft_ = false;
  unsigned homed_ = 0;
  std::array<double, 3> counted_from_rad_{};
  SoftHand hand_;
  HandPath path_;
  TimePoint told_{}, now_{};
};

}  // namespace needlelab::test
