/// The stand-in's mechanics: the Desktop's handle, and the hand that holds it. Independent of
/// client/device/hand/simulated_device, so that tests can compare the two.
#pragma once

#include "common/haptics/geometry.h"

namespace standin {

using needlelab::Pose;
using needlelab::Quat;
using needlelab::Vec3;

/// A mass (0.35 kg, 1.7 N·s/m, as in DeviceLimits) that rotates like a ball, pulled by a hand of 300 N/m and
/// 3 N·s/m (tests/stability/README.md) with 2 N·m/rad and 0.05 N·m·s/rad.
class Plant {
 public:
  void place(const Pose& pose);
  /// Moves the aim there from its current position.
  void aimAt(const Pose& pose, double seconds);
  void hold(bool holds) { holds_ = holds; }
  void jump(Vec3 by) { pose_.p += by; }
  /// Simulates one millisecond under a wrench.
  void millisecond(Vec3 force_N, Vec3 torque_Nm);

  [[nodiscard]] const Pose& pose() const { return pose_; }
  [[nodiscard]] Vec3 velocity() const { return v_; }
  [[nodiscard]] Vec3 turning() const { return w_; }

 private:
  void substep(double dt, Vec3 force_N, Vec3 torque_Nm);
  Pose pose_, aim_, from_, to_;
  Vec3 v_, w_;
  double way_s_ = 0, gone_s_ = 0;  // of the aim's motion
  bool holds_ = true;
};

}  // namespace standin
