/// The bones of a body near the tip, as planes (FORCE_MODEL.md, "A body").
#pragma once

#include "common/haptics/body.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// Lets BONE act at these planes (in W) instead of at a layer; none: it does not act. `model` is that of a
/// path in a body, in which BONE is live. Not for the haptic thread while it uses the model.
void useBonePlanes(const BonesNear& bones, SceneModel& model);

/// The plane that a touching needle rests on. Real-time safe.
const BonePlane& touchedPlane(const SceneModel& model, const SimState& state);

}  // namespace needlelab
