/// Plans of a simulated hand: the wanted pose of the needle's tip at each time.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// How a hand gets from one pose to the next.
enum class Motion : std::uint8_t {
  kLinear,     ///< constant speed
  kTrapezoid,  ///< 15 % of the time speeding up, constant speed, 15 % slowing down
  kMinJerk,    ///< 10 s³ − 15 s⁴ + 6 s⁵ (Flash and Hogan 1985): how humans reach
};

/// The wanted tip pose and plunger position.
struct HandAim {
  Pose X_WT;
  double plunger = 0;               ///< 0-1
  bool presses_cap_button = false;  ///< kCapButton of the device
};

/// Moves and rests of the tip in W, one after the other. Built once, then read; `at` may run in the haptic
/// thread. Orientations between two poses are the normalised mean of the quaternions (no trigonometry: same
/// bits everywhere).
class HandPlan {
 public:
  explicit HandPlan(const Pose& start = {});

  /// Sets the plunger's start position. Call it before adding anything else. Default: 0.
  HandPlan& plungerAtStart(double plunger);

  /// Rests for `seconds` (more than 0) while the plunger moves to `plunger`.
  HandPlan& hold(double seconds, double plunger);
  HandPlan& hold(double seconds) { return hold(seconds, end().plunger); }
  /// Sets the plunger for the whole plan.
  HandPlan& setPlunger(double plunger);
  /// Rests for `seconds` with the device's cap button pressed, then as long without.
  HandPlan& pressCapButton(double seconds);
  /// Goes to the start of `next` at this peak speed, then follows it.
  HandPlan& then(const HandPlan& next, double speed_mps);
  /// Goes to `to` in `seconds` (more than 0).
  HandPlan& moveIn(const Pose& to, double seconds, Motion motion) {
    return moveIn(to, seconds, end().plunger, motion);
  }
  /// Likewise, while the plunger moves to `plunger`.
  HandPlan& moveIn(const Pose& to, double seconds, double plunger, Motion motion);
  /// Goes to `to` at a peak speed of `speed_mps`. Turns on the spot at 1 rad/s at most.
  HandPlan& moveTo(const Pose& to, double speed_mps, Motion motion);

  /// Returns the aim at `t_s` from the start; the first pose before 0, the last after the end.
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

/// Returns the share of the way, 0-1, at share `t` of the time (clamped to 0-1).
double shareOfWay(Motion motion, double t) noexcept;

/// Returns the rotation of a tip frame with its +z (hub to tip) along `axis` (any length > 0), by the
/// shortest turn from W's z.
Quat orientationAlong(Vec3 axis);

/// Returns a limb's surface normal, out of the tissue, at the surface point nearest to `p_W_m` (+z if that
/// point is not unique).
Vec3 outwardNormal(const Limb& limb, Vec3 p_W_m);
/// Returns the surface point straight above a point within the limb; `n`: outwardNormal there. In a body the
/// nearest one.
Vec3 skinAbove(const Limb& limb, Vec3 p_W_m, Vec3 n);

/// Speeds and times of the ready-made plans.
struct PlanStyle {
  double insertion_speed_mps = 0.02;
  double approach_m = 0.02;  ///< distance of the tip from the surface at start and end
  double rest_s = 0.5;       ///< in free air, before and after
  double hold_s = 2.0;       ///< at the deepest point; the plunger is pressed in its second half
  /// Draws the plunger back in the second quarter of the hold, before the injection. The plunger then starts
  /// at kPlungerBeforeAspiration.
  bool aspirate = false;
};
inline constexpr double kPlungerBeforeAspiration = 0.1;

/// Goes in along `axis` through `entry` to `depth_m` beyond it, holds, injects, and comes out the same way.
HandPlan insertionPlan(Vec3 entry_W_m, Vec3 axis_W, double depth_m, const PlanStyle& style);

/// Goes straight in, by the shortest way, to `target`, a point within the limb; holds, injects, comes out. In
/// a body through `entry_W_m`, if there is one: the shortest way may lie through what must not be touched.
HandPlan targetPlan(const Limb& limb_W, Vec3 target_W_m, const PlanStyle& style,
                    std::optional<Vec3> entry_W_m = std::nullopt);

/// Feels for a landmark with a capped needle: presses on the skin on both sides of it, then over it, with 2.4
/// N by the scene's numbers, or more if the bone is not met by that; then presses the cap button, clear of
/// the skin. `landmark_W_m`: on the bone. The scene lists PALPATION.
HandPlan palpationPlan(const SceneSpec& scene_W, Vec3 landmark_W_m, double speed_mps);

/// Follows the paper's Fig. 10: goes in `miss_rad` beside the way to the target, comes back by two thirds,
/// turns to the target, goes in, holds, comes out. `entry_W_m` as for targetPlan.
HandPlan retryPlan(const Limb& limb_W, Vec3 target_W_m, double miss_rad, const PlanStyle& style,
                   std::optional<Vec3> entry_W_m = std::nullopt);

}  // namespace needlelab
