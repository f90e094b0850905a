/// The trajectory: the line from P0 along u, the layers on it, and how it moves (FORCE_MODEL.md, "Contact",
/// "Near the skin", "Change of trajectory"). Code that each tick needs is inline; the rest is rare and out of
/// line. Real-time safe.
#pragma once

#include <algorithm>

#include "common/haptics/effects/line_layers.h"
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
[[gnu::always_inline]] inline void followAxis(const SceneModel& model, Vec3 axis_W, SimState& state) {
  state.aim_W = state.aim_W + (axis_W - state.aim_W) * model.aim_share;
}

/// Whether the tip is within β of u.
[[gnu::always_inline]] inline bool isWithinTurn(const SceneModel& model, const Tick& tick) {
  return tick.lateral_m <= tick.x_m * turnTangent(model, tick.insertion_m);
}

/// Returns u for a needle that enters with this axis: the axis, mirrored at the skin if it points out, and at
/// most 80° from −n.
Vec3 entryDirection(Vec3 axis_W, Vec3 normal_W) noexcept;

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
