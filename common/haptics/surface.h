/// The limb's surface, and the point where a needle passed through it (FORCE_MODEL.md, "Contact"). Used by
/// the engine's contact, and by code that needs the entry and the normal beforehand.
#pragma once

#include "common/haptics/scene_spec.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// Returns the unit normal out of the tissue at the surface point nearest to `p_W_m`; where it is undefined
/// (at a centre), the direction against `motion`. Real-time safe.
Vec3 surfaceNormal(const Limb& limb, Vec3 p_W_m, Vec3 motion) noexcept;

/// Returns the surface point nearest to `p_W_m`, along the normal there; `motion` as for surfaceNormal. In a
/// body, whose depth is not exact everywhere, found in a few steps up the depth's slope: the nearest one only
/// near the skin.
Vec3 nearestSkin(const Limb& limb, Vec3 p_W_m, Vec3 motion) noexcept;

/// Depth below the nearest skin, negative outside. As signedDepth, whose number deep in a body is only a
/// lower bound. There it is the least of some ways out: on the twelve patients within 0.1 mm of the least of
/// all. It asks the body's depth about 250 times (50 to 150 µs).
double depthBelowSkin(const Limb& limb, Vec3 p_W_m) noexcept;

/// Returns the surface point nearest to `p_W_m` also deep in a body: nearestSkin's where that is as near as
/// depthBelowSkin says, else the end of the least way out. As slow as depthBelowSkin.
Vec3 closestSkin(const Limb& limb, Vec3 p_W_m, Vec3 motion) noexcept;

/// Returns P0: the point with depth 0 between the tips of the last tick and of this one. `before` is the
/// state of the previous tick, outside; `depth_m` > 0 is the depth of `p_W_m`. Real-time safe.
Vec3 entryPoint(const SimState& before, Vec3 p_W_m, double depth_m) noexcept;

}  // namespace needlelab
