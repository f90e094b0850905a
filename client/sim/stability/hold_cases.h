/// The closed-loop cases of a hand that inserts, holds and stops. Private to this folder.
#pragma once

#include "client/sim/stability/case.h"

namespace needlelab {

/// A still hand, a coarse encoder: the force must stand still.
Result<CaseOutcome> holdQuantised(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Many hands, each with its stiffness, damping, tremor and depth: how much the force chatters.
Result<CaseOutcome> holdTremorRandom(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Tremor of any usual size: a hand that rests is seen to rest.
Result<CaseOutcome> tremorStops(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// A slow insertion is smooth, and no stop.
Result<CaseOutcome> slowInsert(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// A hold where one tissue ends and a firmer one begins.
Result<CaseOutcome> boundaryHold(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// A hand that creeps on in the stop: the force still decays to the rejection force.
Result<CaseOutcome> creepThenStop(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Firm tissue, soft hand: the force that decays lets the needle advance, and that must not end the stop.
Result<CaseOutcome> stopOnce(const CaseSettings&, AxialModel, const ForceSourceFactory&);

}  // namespace needlelab
