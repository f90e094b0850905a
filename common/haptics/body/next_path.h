/// An insertion that continues on another path of a body (FORCE_MODEL.md, "A body", "Inside").
#pragma once

#include "common/haptics/body/path_stack.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// Moves what an insertion knows of its layers from a path to the next one, which keeps its skin. Returns the
/// step's flags for it. Real-time safe.
std::uint32_t continueOn(const PathStack& before, PathStack& next, SimState& state) noexcept;

}  // namespace needlelab
