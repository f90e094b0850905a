/// BONE in a body (FORCE_MODEL.md, "A body").
#pragma once

#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// Lets BONE act at the model's `bones` instead of at a layer; none: it does not act. `model` is that of a
/// path in a body, in which BONE is live. Not for the haptic thread while it uses the model.
void useBones(SceneModel& model);

/// The structure that a touching needle rests on. Real-time safe.
StructureIndex touchedBone(const SceneModel& model, const SimState& state) noexcept;

}  // namespace needlelab
