/// The cases of prescribed motion, and random gestures under the passivity observer. Private to this folder
/// and its tests.
#pragma once

#include "client/sim/stability/case.h"

namespace needlelab {

// along u
Result<CaseOutcome> retreatInRamp(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> exitNormal(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> sphereFarSide(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> beyondTheNeedle(const CaseSettings&, AxialModel, const ForceSourceFactory&);

// fixture and orientation limit
Result<CaseOutcome> clampPump(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> tiltPump(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> turnWide(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> grazing85(const CaseSettings&, AxialModel, const ForceSourceFactory&);

/// Bad samples, with the gate in its place; without it they are the negative control.
enum class Gate : bool { kAbsent, kPresent };
Result<CaseOutcome> startsInside(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> teleport(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                             Gate gate = Gate::kPresent);
Result<CaseOutcome> notANumber(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                               Gate gate = Gate::kPresent);
Result<CaseOutcome> frozenDevice(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                                 Gate gate = Gate::kPresent);
Result<CaseOutcome> flippedAxis(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                                Gate gate = Gate::kPresent);

// random gestures
Result<CaseOutcome> randomEnergy(const CaseSettings&, AxialModel, const ForceSourceFactory&);

}  // namespace needlelab
