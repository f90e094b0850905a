/// Shrinks a gesture that fails to one that a person can follow.
#pragma once

#include <cstddef>
#include <functional>

#include "client/sim/stability/gestures/passivity_gesture.h"

namespace needlelab::test {

/// The number of significant decimal digits in the shortest text of `value`: 0 for 0, 1 for 300 or 0.02, 3
/// for 0.125.
int significantDigits(double value);

/// Complexity of a gesture for a reader: less is simpler. Strokes, effects and layers weigh most, then times
/// that are not short, then the digits of its numbers.
double sizeOf(const PassivityGesture& gesture);

struct ShrinkResult {
  PassivityGesture gesture;
  std::size_t tried = 0, taken = 0;  ///< smaller gestures
};

/// `fails` must hold for `gesture`; it is called at most `most_tries` times. Removes strokes, effects,
/// layers, membranes, tremor and encoder, replaces the limb by a plane, shortens, and rounds numbers,
/// repeatedly until nothing helps. Each step reduces `sizeOf`, so it ends. Deterministic.
ShrinkResult shrunk(const PassivityGesture& gesture,
                    const std::function<bool(const PassivityGesture&)>& fails, std::size_t most_tries = 3000);

}  // namespace needlelab::test
