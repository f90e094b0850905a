/// Study `live`: how late a viewer sees a lesson, and what that costs.
#pragma once

#include "client/sim/accuracy/study.h"

namespace needlelab {

/// Live frames of 5 to 200 ms through a real TLS connection on this machine.
Result<AccuracyRows> liveStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& notes);

}  // namespace needlelab
