/// The axial model of a profile and its section, from and to the engine's scene. Private to this folder.
#pragma once

#include "common/base/result.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Sets `spec.axial_model` and every model's section that the profile has; the others keep their defaults.
/// `spec.layers` must be there already. Errors: kInvalidInput for a number that names no model.
Status readModel(const pb::Profile& profile, SceneSpec& spec);

/// The section that the chosen model needs is there, and says of `synthetic` what it can. Errors:
/// kInvalidInput with the field's path.
Status checkModelSection(const pb::Profile& profile);

}  // namespace needlelab
