/// When an insertion begins and ends, and where (DESIGN §3.1). Rare, hence apart from the tick.
#pragma once

#include "haptics/effects/tick.h"

namespace needlelab {

/// Starts an insertion at the tick that crossed the surface: P0, n, u, and all that is remembered set to its
/// beginning. `state` still holds the tick before.
void beginInsertion(const SceneModel& model, SimState& state, const Tick& tick) noexcept;

/// Forgets the insertion.
void endInsertion(SimState& state) noexcept;

}  // namespace needlelab
