/// Compares the engine with a closed form along one gesture.
#pragma once

#include <vector>

#include "client/sim/accuracy/closed_form.h"
#include "client/sim/accuracy/row.h"
#include "common/base/result.h"

namespace needlelab {

/// Seeded gestures of 5 to 20 mm/s that turn between 24.5 and 27.5 mm.
std::vector<TurnGesture> turnGestures(int count);

/// Error of the engine with the scene of `rendered` relative to the formula of `right`, while the needle is
/// in tissue. Each tick's force is held until the next; the formula continues in between. The depth is read
/// in steps of `encoder_m` (0: exact). Errors: those of `compile`.
Result<ForceError> errorOf(const ClosedForm& rendered, const ClosedForm& right, const TurnGesture& gesture,
                           double rate_hz, double encoder_m);

}  // namespace needlelab
