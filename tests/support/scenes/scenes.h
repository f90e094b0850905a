/// Ready-made scenes for tests of the engine, the stability cases and the benchmarks.
#pragma once

#include <array>
#include <string_view>

#include "common/haptics/scene_spec.h"

namespace needlelab::test {

/// The paper's 1-DoF test (§V.A, Fig. 7): one layer, 1 N on the way in, 0.5 N on the way out, 500 N/m.
/// Rejection 0.1 N. Effects: CUTTING, ATTRACTED. Plane z = 0, tissue below.
SceneSpec paperOneDof();

/// The paper's 3-DoF test (Figs. 8-11): six layers of 1, 2, 1.5, 2.5, 3, 4 N, 0.4 N on the way out, 500 N/m,
/// needle 60 mm. Thicknesses (not in the paper) 3, 10, 4, 5, 4 and 14 mm; rejection 0.1 N. Effects: CUTTING,
/// ATTRACTED, CLAMPING, ORIENTATION_LIMIT.
SceneSpec paperSixLayers();

/// The six layers with shaft friction everywhere and membranes on layers 0, 2 and 4: all six effects.
SceneSpec allEffects();

/// The possible limb shapes; the plane is included straight and tilted.
enum class LimbKind { kPlane, kTiltedPlane, kSphere, kCapsule };
inline constexpr std::array<LimbKind, 4> kLimbKinds = {LimbKind::kPlane, LimbKind::kTiltedPlane,
                                                       LimbKind::kSphere, LimbKind::kCapsule};
std::string_view limbName(LimbKind kind);

/// A point on the surface with a gesture's unit directions. In W.
struct Site {
  Vec3 p_surface_m;
  Vec3 inward;              ///< −n
  Vec3 across_1, across_2;  ///< tangents, a right-handed frame with `inward`
};

/// The limb of that kind: sphere of 80 mm, capsule of 45 mm radius and 200 mm length; none of them at the
/// origin.
Limb limbOf(LimbKind kind);
/// A point to insert at on `limbOf(kind)`.
Site siteOf(LimbKind kind);
/// The site for the straight plane z = 0, x to the user.
Site defaultSite();

/// A copy with another limb, effects or modes.
SceneSpec withLimb(SceneSpec scene, LimbKind kind);
SceneSpec withEffects(SceneSpec scene, EffectMask effects);
SceneSpec withClamping(SceneSpec scene, ClampingMode mode);
SceneSpec withStop(SceneSpec scene, StopMode mode);

}  // namespace needlelab::test
