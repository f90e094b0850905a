/// The layers along the needle's line, for the integrals over the inserted length: friction, and the
/// fixture's k (FORCE_MODEL.md, "Contact", "Clamping"). Code that each tick needs is inline. Real-time safe.
#pragma once

#include <algorithm>
#include <limits>

#include "common/haptics/tick.h"

namespace needlelab {

inline constexpr double kMinSlant = 0.05;
/// The fixture's k is averaged over this distance to both sides, because its push uses k′, which would jump
/// at a boundary.
inline constexpr double kBlend_m = 4e-3;

/// c of a line along `u_W`.
inline double slantOf(Vec3 normal_W, Vec3 u_W) {
  return std::max(kMinSlant, -dot(normal_W, u_W));
}

/// The layers along a line that enters at `p_entry_W_m` along `u_W`. The fixture's k is limited to its
/// maximum stiffness.
void layLayers(const SceneModel& model, Vec3 p_entry_W_m, Vec3 u_W, double slant,
               LayersAlong& along) noexcept;
/// As layLayers, for a line straight in under a plane.
void layStraight(const SceneModel& model, LayersAlong& along) noexcept;

/// In a body, on a new path: lays the layers ahead of the tip of the last tick again, and keeps those behind
/// it. The fixture's force may only fall; where it would rise, layers stay as far as the fixture looks ahead.
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

/// Copies what is valid.
void copyLayers(const LayersAlong& from, LayersAlong& to) noexcept;

}  // namespace needlelab
