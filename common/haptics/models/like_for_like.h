/// Converts a scene to another axial model, for comparisons.
#pragma once

#include <string>
#include <vector>

#include "common/haptics/scene_spec.h"

namespace needlelab {

/// E of a layer in FEM if the scene gives no lateral stiffness: soft tissue.
inline constexpr double kDefaultYoung_Pa = 10e3;
inline constexpr double kDefaultPoisson = 0.45;
/// Nodes of a derived FEM mesh: the needle's stiffness is within 1 % of that with three times as many nodes.
inline constexpr int kDefaultFemNodes = 10'000;
/// In a derived STATISTICAL section, sd is this share of the mean; it is synthetic, not measured.
inline constexpr double kSyntheticSdShare = 0.1;

/// Returns the scene with its model replaced by `model`. If the scene already has the section of that model
/// (a table with rows, `first_order` or `okamura` of a layer, `fem` with layers, a stiffness that is not the
/// default), it is kept; otherwise it is derived from the layers, where f_i is the cutting force of layer i
/// (0 if CUTTING is not listed) and K_t the tracking wall's stiffness:
/// - DIRECT, VOIGT, GOD_OBJECT: stiffness K_t, the rest at its default.
/// - PRECOMPUTED: the tracking wall's force over depth in a straight insertion: cutting rises
///   with slope K_t below each layer's top as far as f_i or the layer's bottom, falls and attracted forces
///   change within 10 µm.
/// - STATISTICAL: mean as the cutting force of PRECOMPUTED, sd 10 % of it: synthetic.
/// - FIRST_ORDER: cutting f_i; friction of the layer if SHAFT_FRICTION is listed, else 0; puncture force
///   and secant stiffness of the layer's membrane where PUNCTURE is listed and the layer has one, else
///   puncture force f_i − f_{i−1} (at least 1 mN) with stiffness K_t. Both effects are removed from the list,
///   CUTTING
///   is added.
/// - OKAMURA, DAHL: cutting, puncture force and kinetic friction as FIRST_ORDER; linear and quadratic
///   stiffness of the membrane, or K_t and 0; static friction 1.55 times kinetic in and 1.75 times out,
///   viscous 24.5 and 20.1 s/m times kinetic: assumptions (frictionAssumption). For a scene that lists
///   neither
///   SHAFT_FRICTION nor PUNCTURE, both give the forces of FIRST_ORDER.
/// - FEM: E from the lateral stiffness per length k' of a rigid needle, k' = 8πG (1 − ν)/((3 − 4ν) ln(R/r)),
///   the leading term of a rigid disc moved in plane strain (Baguelin, Frank and Said 1977) with R/r = 100:
///   E = 1.16 k' at ν = 0.45; 10 kPa where k' is 0. Cutting and friction as for FIRST_ORDER, SHAFT_FRICTION
///   is removed. `fem.compliance` does not change: common/fem makes it before `compile`.
/// The scene must be valid. Not for the haptic thread.
SceneSpec likeForLike(const SceneSpec& scene, AxialModel model);

/// The assumptions about friction in OKAMURA and DAHL in a scene from `likeForLike`, for readers of a result,
/// as a sentence without full stop: the four ratios above are from memory, for bovine liver in Okamura,
/// Simone and O'Leary (2004), and have not been checked against the paper. Empty for other models, and if the
/// scene has its own `okamura` sections.
std::string frictionAssumption(const SceneSpec& scene, AxialModel model);

/// Returns the table of PRECOMPUTED, derived as above.
std::vector<PrecomputedSpec::Row> forceTableOfLayers(const SceneSpec& scene);

}  // namespace needlelab
