/// Plans of a simulated hand: where the needle's tip shall be at each time.
#pragma once

#include <cstdint>
#include <vector>

#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// How a hand gets from one pose to the next.
enum class Motion : std::uint8_t {
  kLinear,     ///< constant speed
  kTrapezoid,  ///< 15 % of the time speeding up, constant speed, 15 % slowing down
  kMinJerk,    ///< 10 s³ − 15 s⁴ + 6 s⁵ (Flash and Hogan 1985): how people reach
};

/// Where the tip shall be, and the plunger.
struct HandAim {
  Pose X_WT;
  double plunger = 0;  ///< 0-1
};

/// Moves and rests of the tip in W, one after the other. Built once, then read; `at` may run in the haptic
/// thread. Orientations between two poses are the normalised mean of the quaternions (no trigonometry: same
/// bits everywhere).
class HandPlan {
 public:
  explicit HandPlan(const Pose& start = {});

  /// Where the plunger is at the start; before anything else is added. Without it: 0.
  HandPlan& plungerAtStart(double plunger);

  /// Rests for `seconds` (more than 0), the plunger going to `plunger` meanwhile.
  HandPlan& hold(double seconds, double plunger);
  HandPlan& hold(double seconds) { return hold(seconds, end().plunger); }
  /// Goes to `to` in `seconds` (more than 0).
  HandPlan& moveIn(const Pose& to, double seconds, Motion motion) {
    return moveIn(to, seconds, end().plunger, motion);
  }
  /// The same, the plunger going to `plunger` meanwhile.
  HandPlan& moveIn(const Pose& to, double seconds, double plunger, Motion motion);
  /// Goes to `to`; `speed_mps` is the greatest speed on the way. Turns on the spot at 1 rad/s at most.
  HandPlan& moveTo(const Pose& to, double speed_mps, Motion motion);

  /// The aim at `t_s` from the start; the first pose before 0, the last after the end.
  [[nodiscard]] HandAim at(double t_s) const noexcept;
  [[nodiscard]] double duration_s() const noexcept { return end_s_; }
  [[nodiscard]] HandAim start() const noexcept { return start_; }
  [[nodiscard]] HandAim end() const noexcept { return segments_.empty() ? start_ : segments_.back().to; }

 private:
  struct Segment {
    double start_s = 0, duration_s = 0;
    HandAim from, to;
    Motion motion = Motion::kLinear;
  };
  void add(const HandAim& to, double seconds, Motion motion);
  HandAim start_;
  std::vector<Segment> segments_;
  double end_s_ = 0;
};

/// Share of the way, 0-1, at share `t` of the time (held to 0-1).
double shareOfWay(Motion motion, double t) noexcept;

/// Rotation of a tip frame whose +z (hub to tip) is `axis` (any length > 0), by the shortest turn from W's z.
Quat orientationAlong(Vec3 axis);

/// Surface normal of a limb, out of the tissue, at the surface point nearest to `p_W_m` (+z where that is not
/// unique).
Vec3 outwardNormal(const Limb& limb, Vec3 p_W_m);

/// Speeds and times of the ready-made plans.
struct PlanStyle {
  double insertion_speed_mps = 0.02;
  double approach_m = 0.02;  ///< the tip starts and ends this far from the surface
  double rest_s = 0.5;       ///< in free air, before and after
  double hold_s = 2.0;       ///< at the deepest point; the plunger is pressed in its second half
  /// Before that, in the second quarter of the hold, the plunger is drawn back: from
  /// kPlungerBeforeAspiration, where it is from the start.
  bool aspirate = false;
};
inline constexpr double kPlungerBeforeAspiration = 0.1;

/// In along `axis` through `entry` until `depth_m` beyond it along the axis, hold, inject, out the same way.
HandPlan insertionPlan(Vec3 entry_W_m, Vec3 axis_W, double depth_m, const PlanStyle& style);

/// Straight in, by the shortest way, to `target`, a point within the limb; hold, inject, out.
HandPlan targetPlan(const Limb& limb_W, Vec3 target_W_m, const PlanStyle& style);

/// As the paper's Fig. 10: in, but `miss_rad` beside the way to the target; back by two thirds; turned to the
/// target; in; hold; out.
HandPlan retryPlan(const Limb& limb_W, Vec3 target_W_m, double miss_rad, const PlanStyle& style);

}  // namespace needlelab
