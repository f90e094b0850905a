/// Prescribed motions of the needle's tip for tests: seeded, deterministic, using only + − × ÷ sqrt (no
/// libm), so that the same motion has the same bits in every build and on every machine.
#pragma once

#include <cstdint>
#include <vector>

#include "common/haptics/engine.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {

using Motion = std::vector<TipSample>;

/// Shortest rotation from +z to `axis` (unit); half a turn about x for axis = −z.
Quat pointing(Vec3 axis);
/// The unit vector `axis` tilted by atan(`tangent`) toward the unit vector `toward` (⟂ axis).
Vec3 tilted(Vec3 axis, double tangent, Vec3 toward);

/// Builds a motion piece by piece; ticks at `rate_hz`.
class MotionBuilder {
 public:
  MotionBuilder(double rate_hz, Vec3 p_start_m, Vec3 axis);
  /// Minimum-jerk path to `p_m`, with the axis turning evenly to `axis`.
  MotionBuilder& moveTo(Vec3 p_m, Vec3 axis, double seconds);
  MotionBuilder& moveTo(Vec3 p_m, double seconds) { return moveTo(p_m, axis_, seconds); }
  /// Constant speed along a straight line: |p − last| / speed seconds.
  MotionBuilder& slideTo(Vec3 p_m, double speed_mps);
  MotionBuilder& hold(double seconds);
  [[nodiscard]] const Motion& samples() const { return samples_; }
  [[nodiscard]] Motion take() { return std::move(samples_); }

 private:
  [[nodiscard]] std::size_t ticks(double seconds) const;
  double rate_hz_;
  Vec3 p_, axis_;
  Motion samples_;
};

/// From `outside_m` above the site along `direction` (unit, into the tissue) to `length_m` inside, hold, and
/// out again. The needle's axis is `axis`.
Motion insertHoldWithdraw(double rate_hz, const Site& site, Vec3 direction, Vec3 axis, double length_m,
                          double speed_mps, double hold_s, double outside_m = 0.005);

/// Adds a tremor: two waves between 8 and 12 Hz on each axis, `amplitude_m` peak at most.
Motion withTremor(Motion motion, double rate_hz, double amplitude_m, std::uint64_t seed);
/// Rounds every coordinate to the nearest multiple of `step_m` (an encoder).
Motion quantised(Motion motion, double step_m);
/// One motion after the other.
Motion joined(Motion first, const Motion& second);

/// Bounds of a random gesture.
struct GestureRange {
  double above_m = 0.012, below_m = 0.045;  ///< waypoints' depth, along the site's inward direction
  double aside_m = 0.012;                   ///< waypoints' lateral distance
  double tilt_tangent = 0.9;                ///< waypoints' maximum tilt
  double least_leg_s = 0.08, most_leg_s = 0.8;
  int legs = 8;
  double hold_chance = 0.4, most_hold_s = 1.2;
  double tremor_m = 0;
};

/// A smooth gesture through random waypoints around the site: insertions, holds, tilts, sideways moves,
/// withdrawals, several entries. Starts and ends outside.
Motion randomGesture(std::uint64_t seed, double rate_hz, const Site& site, const GestureRange& range = {});

/// Slides through the surface, in and out, on a path with `slope` (rise over run) to it and the axis along
/// the path: grazing.
Motion grazing(double rate_hz, const Site& site, double slope, double length_m, double speed_mps);

/// `count` short insertions beside each other.
Motion multipleEntries(std::uint64_t seed, double rate_hz, const Site& site, int count);

}  // namespace needlelab::test
