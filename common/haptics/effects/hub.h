/// The hub on the skin (FORCE_MODEL.md, "Hub"): rare, hence out of line.
#pragma once

#include "common/haptics/tick.h"

namespace needlelab {

/// K_h; 0 if HUB is not live.
double hubStiffness_N_per_m(const SceneModel& model);

/// For ticks with d_t > L: sets the flag and report.hub_N, and returns the force. `arm_W_m`: p − P0, of
/// length d_t.
Vec3 pressHub(const SceneModel& model, Vec3 arm_W_m, double insertion_m, StepReport& report) noexcept;

}  // namespace needlelab
