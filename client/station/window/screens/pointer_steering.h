/// Converts mouse and keys to a target for the simulated hand. Pure logic of the window's side.
#pragma once

#include <optional>

#include "client/device/hand/hand.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// A person's input since the last frame. Directions refer to the picture.
struct SteerInput {
  double dt_s = 0;  ///< clamped to 0.1, so that nothing jumps after a stall of the window
  double across_right_px = 0, across_up_px = 0;  ///< dragged with the left button
  double tilt_right_px = 0, tilt_up_px = 0;      ///< dragged with the right button
  double wheel = 0;                              ///< notches; positive (away from the person): insertion
  int advance = 0;                               ///< keys: 1 in, −1 out
  int across_right = 0, across_up = 0;           ///< keys, −1 to 1
  int tilt_right = 0, tilt_up = 0;
  bool fine = false;                 ///< a quarter of every speed
  bool press = false, draw = false;  ///< the plunger, while the key is down
  /// Whether it moves the needle.
  [[nodiscard]] bool moves() const {
    return advance != 0 || across_right != 0 || across_up != 0 || tilt_right != 0 || tilt_up != 0 ||
           wheel != 0 || across_right_px != 0 || across_up_px != 0 || tilt_right_px != 0 || tilt_up_px != 0;
  }
};

/// A person's view of W: orthogonal unit vectors.
struct SteerView {
  Vec3 right_W{0, 1, 0}, up_W{0, 0, 1};
};

/// Unit vectors at right angles to the needle: right in the picture, and away from the person, which is up in
/// the picture. `axis_W`: unit, from hub to tip.
struct DirectionsAcross {
  Vec3 right_W, away_W;
};
DirectionsAcross directionsAcross(Vec3 axis_W, const SteerView& view);

/// Moves the needle in a person's hand. `advance` moves along the needle; `across` moves it at right angles
/// to the needle without rotation (right, and away from the person for "up"); `tilt` rotates it about its tip
/// and moves the syringe to that side. Thread: one.
class PointerSteering {
 public:
  static constexpr double kAdvance_mps = 0.012, kAcross_mps = 0.02, kTilt_radps = 0.5;
  static constexpr double kAcross_m_per_px = 1e-4, kTilt_rad_per_px = 3e-3, kWheel_m = 1e-3;
  static constexpr double kPress_per_s = 1.0 / 3;
  /// Limit of the target's distance from the tip, so that a push against bone does not load the spring
  /// without limit.
  static constexpr double kLeash_m = 0.02;
  static constexpr double kFineShare = 0.25;

  explicit PointerSteering(const SteeringTarget& start) : target_(start) {}

  /// Updates the target once per frame. `tip_W_m`: the tip's true position.
  const SteeringTarget& update(const SteerInput& input, const SteerView& view, Vec3 tip_W_m);
  /// Goes to this pose, until a person moves the needle; the plunger stays.
  void lineUp(const Pose& X_WT) { lines_up_at_ = X_WT; }
  [[nodiscard]] const SteeringTarget& target() const { return target_; }

 private:
  SteeringTarget target_;
  std::optional<Pose> lines_up_at_;
};

}  // namespace needlelab
