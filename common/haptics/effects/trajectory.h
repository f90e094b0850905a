/// The trajectory: the line from P0 along u, the layers on it, and how it moves (FORCE_MODEL.md, "Contact",
/// "Near the skin", "Change of trajectory"). Code that each tick needs is inline; the rest is rare and out of
/// line. Real-time safe.
#pragma once

#include <algorithm>

#include "common/haptics/tick.h"

namespace needlelab {

/// A needle lies flat on the skin if its axis has at most this component along the skin's normal at entry.
inline constexpr double kCos80Degrees = 0.17364817766693034885;

/// Closer to the skin than this, P0 and u follow the needle as the hand holds it.
inline constexpr double kFollow_m = 0.6e-3;
/// How far P0 may be from the line through the tip: half a needle's radius.
inline constexpr double kHole_m = 0.05e-3;
/// Deeper than kFollow_m, P0 may be this many times further from the line than the tip is below kFollow_m.
inline constexpr double kSlack = 3;
/// The fixture's k is averaged over this distance to both sides, because its push uses k′, which would jump
/// at a boundary.
inline constexpr double kBlend_m = 4e-3;
/// Where δ and h differ by no more, the tip is on P0's side of a round limb.
inline constexpr double kSameSide_m = 0.05e-3;
/// A hole this far from where the skin was pierced is another one.
inline constexpr double kHoleWidth_m = 1e-3;

/// Up to this d_t (or a quarter of the needle's length, if less) a turn lays the layers along u again.
inline constexpr double kLayAgain_m = 5e-3;
/// u turns no farther than the needle's axis was pointing this time ago: noise in the measured axis would
/// turn it bit by bit.
inline constexpr double kAimTime_s = 0.05;

/// tan β at the skin, far above rounding.
inline constexpr double kLeastTurnTangent = 1e-4;

/// tan β: the tip is held up to the angle β from u, and a tip further aside turns u. (d_t/L)² is tan²(45° −
/// α) of the paper's cone α: what the cone takes from the freedom to re-aim, squared. At most 45°.
[[gnu::always_inline]] inline double turnTangent(const SceneModel& model, double insertion_m) {
  return std::min(1.0, kLeastTurnTangent + insertion_m * insertion_m * model.inverse_needle_squared_per_m2);
}

/// Moves the aim toward this tick's axis: a first-order lag.
[[gnu::always_inline]] inline void followAxis(const SceneModel& model, const TipSample& sample,
                                              SimState& state) {
  state.aim_W = state.aim_W + (unitAxis(sample) - state.aim_W) * model.aim_share;
}

/// Whether the tip is within β of u.
[[gnu::always_inline]] inline bool isWithinTurn(const SceneModel& model, const Tick& tick) {
  return tick.lateral_m <= tick.x_m * turnTangent(model, tick.insertion_m);
}

/// Returns u for a needle that enters with this axis: the axis, mirrored at the skin if it points out, and at
/// most 80° from −n.
Vec3 entryDirection(Vec3 axis_W, Vec3 normal_W) noexcept;

/// The layers along a line that enters at `p_entry_W_m` along `u_W`. The fixture's k is limited to its
/// maximum stiffness.
void layLayers(const SceneModel& model, Vec3 p_entry_W_m, Vec3 u_W, double slant,
               LayersAlong& along) noexcept;
/// As layLayers, for a line straight in under a plane.
void layStraight(const SceneModel& model, LayersAlong& along) noexcept;

/// In a body, on a new path: lays the layers ahead of the tip of the last tick again, and keeps those behind
/// it. The fixture's force and energy may only fall; where they would rise, layers stay as far as the fixture
/// looks ahead.
void relayLayers(const SceneModel& model, SimState& state) noexcept;

/// Stiffness of the fixture at an inserted length.
struct LateralStiffness {
  double k_N_per_m = 0;       ///< ∫₀^d lateral stiffness, averaged over ±kBlend_m
  double slope_N_per_m2 = 0;  ///< k′
};

/// Sets `stiffness_here` to the span of this inserted length.
void findStiffness(LayersAlong& along, double insertion_m) noexcept;

[[gnu::always_inline]] inline LateralStiffness lateralStiffness(LayersAlong& along, double insertion_m) {
  const StiffnessSpan& span = along.stiffness_here;
  if (!(insertion_m >= span.begin_m && insertion_m < span.end_m)) [[unlikely]]
    findStiffness(along, insertion_m);
  const double t = insertion_m - span.begin_m, bend = t * span.half_bend_N_per_m3;
  return {span.k_N_per_m + t * (span.slope_N_per_m2 + bend), span.slope_N_per_m2 + 2.0 * bend};
}

/// The energy of the fixture: ½ k e², linear in e beyond the maximum force.
double fixtureEnergy(const SceneModel& model, double k_N_per_m, double lateral_m) noexcept;

/// A needle past the middle of a round limb has P0's skin behind it, until it is back on P0's side.
[[gnu::always_inline]] inline void followMiddle(const SceneModel& model, const Tick& tick, SimState& state) {
  if (!(tick.x_m >= state.along.deepest_m) && !state.past_middle) [[likely]]
    return;
  state.past_middle = !model.is_plane && heightOf(model, state, tick) - tick.depth_m > kSameSide_m;
}

enum class Follow { kStays, kNearSkin, kDeeper };  ///< the line's move; kDeeper: below kFollow_m

/// Near the skin, or far off the line close to it, moves P0 and u after the needle. Project again unless the
/// line stays.
Follow followNearSkin(const SceneModel& model, const TipSample& sample, Tick tick, SimState& state) noexcept;

/// Change of trajectory: where the tip is further than β from u, turns u about P0 toward it, at most to the
/// needle's axis. Returns whether it turned; if so, project again.
bool turnTrajectory(const SceneModel& model, const TipSample& sample, SimState& state) noexcept;

}  // namespace needlelab
