/// The trajectory: the line from P0 along u, the layers on it, and how it moves (FORCE_MODEL.md, "Contact",
/// "Near the skin", "Change of trajectory"). What each tick needs is inline, the rest rare and out of line.
/// Real-time safe.
#pragma once

#include <algorithm>

#include "common/haptics/tick.h"

namespace needlelab {

/// A needle whose axis has no more than this along the skin's normal at its entry lies on the skin.
inline constexpr double kCos80Degrees = 0.17364817766693034885;

/// Nearer to the skin than this, P0 and u are those of a needle that enters as the hand holds it.
inline constexpr double kFollow_m = 0.6e-3;
/// P0 may be so far from the line through the tip: half a needle's radius.
inline constexpr double kHole_m = 0.05e-3;
/// Deeper, P0 may be so many times further from the line than the tip is below that.
inline constexpr double kSlack = 5;
/// The fixture's k is averaged over so much to both sides: it pushes with k′, which would jump at a boundary.
inline constexpr double kBlend_m = 4e-3;
/// Up to this d_t (a quarter of the needle's length, if that is less) u follows the hand.
inline constexpr double kFreeTurn_m = 5e-3;
/// Below this force u is not turned.
inline constexpr double kTurnsFrom_N = 1e-3;

/// The force up to which the fixture holds u: 1 mN where u follows the hand, the fixture's greatest from half
/// the needle's length on, and never for a deviation above `hold_m`.
[[gnu::always_inline]] inline double turningForce(const SceneModel& model, const LayersAlong& along,
                                                  double k_N_per_m, double insertion_m) {
  const double rising_N = model.turn_slope_N_per_m * (insertion_m - model.turn_begins_m);
  const double held_N = std::min(rising_N, k_N_per_m * along.hold_m);
  return std::min(std::max(kTurnsFrom_N, held_N), model.fixture.max_force_N);
}

/// A quick test that the fixture's force does not reach `turningForce`, nor its greatest.
[[gnu::always_inline]] inline bool surelyHolds(const SceneModel& model, const LayersAlong& along,
                                               const Tick& tick, double force_N) {
  const double rising_N = model.turn_slope_N_per_m * (tick.insertion_m - model.turn_begins_m);
  return force_N <= std::max(kTurnsFrom_N, rising_N) && tick.lateral_m <= along.hold_m &&
         force_N <= model.fixture.max_force_N;
}

/// u of a needle that enters with this axis: the axis, mirrored at the skin if it points out, and at most 80°
/// from −n.
Vec3 entryDirection(Vec3 axis_W, Vec3 normal_W) noexcept;

/// The layers along a line that enters at `p_entry_W_m` along `u_W`. The fixture's k ends at its greatest
/// stiffness.
void layLayers(const SceneModel& model, Vec3 p_entry_W_m, Vec3 u_W, double slant,
               LayersAlong& along) noexcept;
/// The same for a line straight in, under a plane.
void layStraight(const SceneModel& model, LayersAlong& along) noexcept;

/// Stiffness of the fixture at an inserted length.
struct LateralStiffness {
  double k_N_per_m = 0;       ///< ∫₀^d lateral stiffness, averaged over ±kBlend_m
  double slope_N_per_m2 = 0;  ///< k′
};

/// Makes `stiffness_here` the span of this inserted length.
void findStiffness(LayersAlong& along, double insertion_m) noexcept;

[[gnu::always_inline]] inline LateralStiffness lateralStiffness(LayersAlong& along, double insertion_m) {
  const StiffnessSpan& span = along.stiffness_here;
  if (!(insertion_m >= span.begin_m && insertion_m < span.end_m)) [[unlikely]]
    findStiffness(along, insertion_m);
  const double t = insertion_m - span.begin_m, bend = t * span.half_bend_N_per_m3;
  return {span.k_N_per_m + t * (span.slope_N_per_m2 + bend), span.slope_N_per_m2 + 2.0 * bend};
}

/// The energy of the fixture: ½ k e², linear in e beyond the greatest force.
double fixtureEnergy(const SceneModel& model, double k_N_per_m, double lateral_m) noexcept;

enum class Follow { kStays, kNearSkin, kDeeper };  ///< the line's move; kDeeper: below kFollow_m

/// Near the skin, or far aside close to it: P0 and u come after the needle. Project again unless it stays.
Follow followNearSkin(const SceneModel& model, const TipSample& sample, Tick tick, SimState& state) noexcept;

/// Change of trajectory: where the fixture's force exceeds `turningForce`, turns u about P0 toward the tip
/// until it does not. Returns whether it turned; then project again.
bool turnTrajectory(const SceneModel& model, const TipSample& sample, SimState& state) noexcept;

}  // namespace needlelab
