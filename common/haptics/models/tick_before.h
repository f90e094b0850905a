/// Where the tip was at the tick before, for models that interpolate or differentiate. Inside `apply` only.
#pragma once

#include "common/haptics/sim_state.h"

namespace needlelab {

struct TickBefore {
  double x_m = 0;      ///< along the present u
  double depth_m = 0;  ///< δ
};

/// At the entry tick P0: x = 0 and δ = 0 (DESIGN §3.5).
inline TickBefore tickBefore(const SimState& state) {
  if (state.ticks_inside == 1) return {};
  return {state.x_history_m[(state.ticks_inside - 1) & state.history_mask] + state.x_shift_m,
          state.depth_prev_m};
}

}  // namespace needlelab
