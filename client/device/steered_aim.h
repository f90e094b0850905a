/// The aim of a hand that somebody steers: it goes after the newest wish as an arm would, smoothly and not
/// too fast.
#pragma once

#include <memory>

#include "client/device/hand_plan.h"
#include "client/device/hand_steering.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Wishes come 30 times a second, in steps, and may jump; the aim speeds up over 25 ms, slows down near its
/// goal, and never goes faster than this. At rest it is where the wish is.
inline constexpr double kMostAimSpeed_mps = 0.1;
inline constexpr double kMostAimTurn_radps = 1.5;
inline constexpr double kMostPlungerSpeed_per_s = 0.8;

/// Pure logic on the hand's own steps. A wish that is not finite, or whose quaternion is no rotation, is
/// passed over. Thread: one at a time. `next` is real-time safe.
class SteeredAim {
 public:
  /// `step_s`: time between two calls of `next`.
  SteeredAim(std::shared_ptr<HandSteering> steering, const HandAim& start, double step_s);
  /// The aim one step later.
  HandAim next() noexcept;

 private:
  std::shared_ptr<HandSteering> steering_;
  double step_s_, share_;
  HandAim aim_;
  SteeringWish wish_;
  Vec3 v_W_mps_, w_W_radps_;
};

}  // namespace needlelab
