/// Mouse and keys to a target for the simulated hand: pure logic of the window's side.
#pragma once

#include "client/device/hand.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// A person's input since the last frame. Directions are those of the picture.
struct SteerInput {
  double dt_s = 0;                               ///< held to 0.1: a window that stood still lets nothing jump
  double across_right_px = 0, across_up_px = 0;  ///< dragged with the left button
  double tilt_right_px = 0, tilt_up_px = 0;      ///< dragged with the right button
  double wheel = 0;                              ///< notches; positive (away from the person) goes in
  int advance = 0;                               ///< keys: 1 in, −1 out
  int across_right = 0, across_up = 0;           ///< keys, −1 to 1
  int tilt_right = 0, tilt_up = 0;
  bool fine = false;                 ///< a quarter of every speed
  bool press = false, draw = false;  ///< the plunger, as long as it lasts
};

/// How a person sees W: unit vectors, at right angles.
struct SteerView {
  Vec3 right_W{0, 1, 0}, up_W{0, 0, 1};
};

/// The needle as a person holds it: `advance` goes along it, `across` moves it without turning it (to the
/// right, and for "up" away from the person: across the needle, not along), `tilt` turns it about its tip, so
/// that the syringe goes to that side. Thread: one.
class PointerSteering {
 public:
  static constexpr double kAdvance_mps = 0.012, kAcross_mps = 0.02, kTilt_radps = 0.5;
  static constexpr double kAcross_m_per_px = 1e-4, kTilt_rad_per_px = 3e-3, kWheel_m = 1e-3;
  static constexpr double kPress_per_s = 1.0 / 3;
  /// The target never goes further from the tip, so that pushing against bone does not load a spring without
  /// end.
  static constexpr double kLeash_m = 0.02;
  static constexpr double kFineShare = 0.25;

  explicit PointerSteering(const SteeringTarget& start) : target_(start) {}

  /// One frame; `tip_W_m`: where the tip really is.
  const SteeringTarget& update(const SteerInput& input, const SteerView& view, Vec3 tip_W_m);
  [[nodiscard]] const SteeringTarget& target() const { return target_; }

 private:
  SteeringTarget target_;
};

}  // namespace needlelab
