/// Study `rate`: what a faster haptic loop gives, and costs.
#pragma once

#include "client/sim/accuracy/study.h"

namespace needlelab {

/// The same hand in closed loop at 250 Hz to 10 kHz; error of the force that acts on the hand against a loop
/// of 20 kHz.
Result<AccuracyRows> rateStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& notes);

}  // namespace needlelab
