/// Study `model`: the axial models against what the scene asks for.
#pragma once

#include "client/sim/accuracy/study.h"

namespace needlelab {

/// The force along the trajectory of every model (likeForLike) over the same seeded gestures, against
/// ForceProfile. A model that cannot be made is left out with a note.
Result<AccuracyRows> modelProfileStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                       std::vector<std::string>& notes);

}  // namespace needlelab
