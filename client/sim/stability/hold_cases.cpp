#include "client/sim/stability/hold_cases.h"

namespace needlelab {

std::vector<StabilityCase> holdCases() {
  return {
      {"hold_quantised", "a still hand, encoder of 30 µm: the force stands still", true, false,
       holdQuantised},
      {"hold_tremor_random", "many hands with tremor: how much the force chatters", true, false,
       holdTremorRandom},
      {"tremor_stops", "a hand that rests is seen to rest, whatever its tremor", true, false, tremorStops},
      {"slow_insert_5mm_s", "a slow insertion is smooth, and no stop", true, false, slowInsert},
      {"boundary_hold", "a hold where firmer tissue begins", true, false, boundaryHold},
      {"creep_then_stop", "after a creeping advance the force is the rejection force", true, false,
       creepThenStop},
      {"stop_once", "firm tissue and a soft hand: one stop, not many", true, false, stopOnce},
  };
}

}  // namespace needlelab
