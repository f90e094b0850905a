/// The closed-loop cases of stiffness, release, reversal and late ticks. Private to this folder.
#pragma once

#include "client/sim/stability/case.h"

namespace needlelab {

Result<CaseOutcome> stiffnessScan(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> overLimitBounded(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> freeHandRelease(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> skinFlutter(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> frictionReversal(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> lateAndMissingTicks(const CaseSettings&, AxialModel, const ForceSourceFactory&);

}  // namespace needlelab
