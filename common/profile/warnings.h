/// Warnings for a profile's author.
#pragma once

#include <string>
#include <vector>

#include "needlelab/profile.pb.h"

namespace needlelab {

/// How well a layer of this thickness can be felt, 0 to 1: the share of the layer that remains after the
/// wall's spring has come within 10 % of the layer's cutting force (10 % is the assumed just noticeable
/// difference); `φ = max(0, 1 − (Δf − 0.1 f)/(K_t·thickness))`, at most 1; 1 where the force does not rise.
double fidelity(double force_before_N, double force_N, double wall_stiffness_N_per_m, double thickness_m);

/// Returns warnings for the author of a valid profile, one sentence each, with the numbers: membranes that
/// rupture deeper than their layer is thick, layers too thin to feel with a wall (φ < 0.5), listed effects
/// that the axial model does not support, numbers without supporting data. May be empty.
std::vector<std::string> profileWarnings(const pb::Profile& profile);

}  // namespace needlelab
