/// Converts a scene to another axial model, for comparisons.
#pragma once

#include <string>
#include <vector>

#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Nodes of a derived FEM mesh: the needle's stiffness is within 1 % of that with three times as many nodes.
inline constexpr int kDefaultFemNodes = 10'000;

/// Returns the scene with its model replaced by `model`. If the scene already has the section of that model
/// (a table with rows, `first_order` or `okamura` of a layer, `fem` with layers, a stiffness that is not the
/// default), it is kept; otherwise the rule of the model's row (`AxialEntry::derive`) derives it from the
/// layers. Effects that the model has its own of are removed from the list. `fem.compliance` does not change:
/// common/fem makes it before `compile`. The scene must be valid. Not for the haptic thread.
SceneSpec likeForLike(const SceneSpec& scene, AxialModel model);

/// What that rule assumes about friction, for readers of a result, as a sentence without full stop. Empty for
/// most models, and if the scene has their sections.
std::string frictionAssumption(const SceneSpec& scene, AxialModel model);

/// Returns the table of PRECOMPUTED: the tracking wall's force over depth in a straight insertion. Cutting
/// rises with slope K_t below each layer's top as far as the layer's cutting force or bottom; falls and
/// attracted forces change within 10 µm.
std::vector<PrecomputedSpec::Row> forceTableOfLayers(const SceneSpec& scene);

}  // namespace needlelab
