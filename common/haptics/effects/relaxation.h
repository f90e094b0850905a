/// How a wall relaxes in a stop: it comes up to the needle until a rest is left (paper eq. 4 and 5, as a ramp
/// that depends on the needle's place; FORCE_MODEL.md, "Tracking wall", 2). The walls of cutting and of
/// friction relax, each by its own. Every move only shortens the wall's spring.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>

#include "common/haptics/engine.h"

namespace needlelab {

/// A compliant hand follows the ramp's wall: the ramp may move this many times as far as for a hand at rest.
inline constexpr double kRampWays = 6.0;
/// After the ramp the wall follows a drifting hand at up to this speed.
inline constexpr double kDriftSpeed_mps = 0.12e-3;

/// A gap this small begins no ramp: rounding would give it a slope.
inline constexpr double kLeastGap_m = 1e-9;

/// How far a RAMP's wall moves in a tick of a stop, toward a needle that is `gap_m` beyond the rest. The ramp
/// closes the gap and lasts one dwell longer, because a hand still yields for a while; then the wall only
/// follows a drift.
[[gnu::always_inline]] inline double rampStep(const SceneModel& model, Relaxation& wall, double gap_m,
                                              bool begins) {
  assert(gap_m >= 0.0);
  if (begins) {
    wall.ramp_ticks = gap_m > kLeastGap_m ? model.dwell_ticks : 0;
    wall.step_m = gap_m / model.stop_ticks;
    wall.way_m = kRampWays * gap_m;
  }
  if (wall.ramp_ticks == 0) return std::min(gap_m, model.drift_step_m);
  const double step_m = std::min({wall.step_m, gap_m, model.max_stop_step_m});
  assert(step_m >= 0.0);
  wall.way_m -= step_m;
  if (step_m == gap_m || wall.ramp_ticks < model.dwell_ticks) --wall.ramp_ticks;
  if (wall.way_m <= 0.0) wall.ramp_ticks = 0;
  return step_m;
}

/// Returns the place of a wall after a tick of a stop. `rest_m`: the stretch that a stop leaves.
[[gnu::always_inline]] inline double relaxedWall(const SceneModel& model, Relaxation& wall, double wall_m,
                                                 double x_m, double rest_m, bool begins) {
  const double stretch = x_m - wall_m;
  const double size = std::fabs(stretch);
  double move;
  if (model.wall.stop_mode == StopMode::kRamp) {
    move = rampStep(model, wall, std::max(0.0, size - rest_m), begins);
  } else {
    if (begins) wall.stretch_m = size;
    const double rest = std::max(rest_m, model.wall.relax_residual * wall.stretch_m);
    move = std::min(std::max(0.0, size - rest) * model.relax_share, model.max_stop_step_m);
  }
  assert(move >= 0.0 && !(move > size) && "the wall only comes nearer");
  return wall_m + std::copysign(move, stretch);
}

}  // namespace needlelab
