/// A law of the user's own instead of a scene's axial model.
#pragma once

#include <memory>

#include "common/library/scene_handle.h"

namespace needlelab {

/// As nl_scene_with_law. Errors: kInvalidInput for a body, and for a slope outside [0, 10000] N/m.
Result<std::unique_ptr<nl_scene>> sceneWithLaw(const nl_scene& scene, nl_law law, void* user,
                                               double steepest_N_per_m);

}  // namespace needlelab
