/// Makes a gesture that fails smaller while it goes on failing, so that a person can see why.
#pragma once

#include <cstddef>
#include <functional>

#include "client/sim/stability/passivity_gesture.h"

namespace needlelab {

struct ShrinkResult {
  PassivityGesture gesture;
  std::size_t tried = 0, taken = 0;  ///< smaller gestures
};

/// `fails` must hold for `gesture` (and is asked at most `most_tries` times). Removes strokes, effects,
/// layers, membranes, tremor and encoder, replaces the limb by a plane, shortens, and rounds numbers, over
/// and over until nothing helps. Each step makes `sizeOf` less, so it ends. Deterministic.
ShrinkResult shrunk(const PassivityGesture& gesture,
                    const std::function<bool(const PassivityGesture&)>& fails, std::size_t most_tries = 3000);

}  // namespace needlelab
