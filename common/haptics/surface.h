/// The limb's surface, and where a needle passed through it (FORCE_MODEL.md, "Contact"): for the engine's
/// contact, and for code that must know the entry and the normal beforehand.
#pragma once

#include "common/haptics/scene_spec.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The unit normal out of the tissue at the surface point nearest to `p_W_m`; where the shape has none (a
/// centre), against `motion`. Real-time safe.
Vec3 surfaceNormal(const Limb& limb, Vec3 p_W_m, Vec3 motion) noexcept;

/// P0: the point on the way from the last tick's tip to this one's where the depth is 0. `before` is the
/// state of the tick before, outside; `depth_m` > 0 is that of `p_W_m`. Real-time safe.
Vec3 entryPoint(const SimState& before, Vec3 p_W_m, double depth_m) noexcept;

}  // namespace needlelab
