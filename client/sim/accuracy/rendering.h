/// A scene rendered by one model over prescribed gestures: forces and the time of a tick. Used by the studies
/// of models.
#pragma once

#include <vector>

#include "client/sim/accuracy/error_sum.h"
#include "client/sim/accuracy/gesture.h"
#include "common/base/clock.h"

namespace needlelab {

/// The force along the trajectory at each tick, in N: cutting, attracted, friction and puncture together.
std::vector<double> axialForces(const SceneModel& model, const StudyGesture& gesture);

/// Whether a change of force is a declared release: it falls at a tick that the engine flags as a layer's
/// change, a rupture or an exit.
bool isRelease(std::uint32_t flags, double before_N, double after_N);

/// Greatest change of the force along the trajectory from one tick to the next that is no release, in N.
double greatestStep_N(const SceneModel& model, const StudyGesture& gesture);

/// Root mean square and greatest of forces − reference while the tip is in the tissue.
ErrorSum errorInTissue(const SceneModel& model, const StudyGesture& gesture,
                       const std::vector<double>& forces_N, const std::vector<double>& reference_N);

/// The engine's tick over a gesture, again and again, for about `budget_s`. Hot.
Timing timeSteps(const SceneModel& model, const StudyGesture& gesture, double budget_s);

}  // namespace needlelab
