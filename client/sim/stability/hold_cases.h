/// The closed-loop cases of a hand that inserts, holds and stops. Private to this folder.
#pragma once

#include "stability/case.h"

namespace needlelab {

Result<CaseOutcome> holdQuantised(const CaseSettings&, AxialModel, const ForceSourceFactory&);

}  // namespace needlelab
