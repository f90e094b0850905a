#include "common/haptics/effects/resume.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/surface.h"
#include "common/haptics/tick.h"

namespace needlelab {
namespace {

/// Half a micrometre in each of three coordinates: the maximum error of a stored place (FORMAT.md).
constexpr double kRounding_m = 0.867e-6;
/// A place is moved this far beyond a boundary.
constexpr double kBeyond_m = 1e-9;

double xOf(const SimState& state) {
  return dot(state.u_W, state.p_prev_W_m - state.p_entry_W_m);
}

// false where each tick computes the wall's place from the layers' tops: such ruptures are not of membranes
bool dragsWall(const SceneModel& model) {
  return !axialEntry(model.axial_model).places_wall;
}

// the pose, moved within its rounding so that it lies in the station's layer
TipSample withinRounding(const SceneModel& model, TipSample sample, const StoredTick& stored) {
  if (stored.layer >= static_cast<std::int32_t>(model.layer_count)) return sample;
  const double depth_m = depthIn(model, sample.p_WT_m);
  double move_m = 0;  // inward
  if (stored.layer < 0) {
    if (depth_m > 0) move_m = -depth_m - kBeyond_m;
  } else {
    const CompiledLayer& layer = model.layers[static_cast<std::size_t>(stored.layer)];
    if (depth_m < layer.min_depth_m)
      move_m = layer.min_depth_m - depth_m + kBeyond_m;
    else if (depth_m >= layer.bottom_m)
      move_m = layer.bottom_m - depth_m - kBeyond_m;
  }
  if (move_m == 0 || std::fabs(move_m) > kRounding_m + kBeyond_m) return sample;
  sample.p_WT_m = sample.p_WT_m - surfaceNormal(model.limb, sample.p_WT_m, {}) * move_m;
  return sample;
}

// lets the walls follow x_c when membranes hold or give way; the walls' forces do not change
double followed(const SceneModel& model, SimState& state, StepReport& report, std::uint32_t ruptured) {
  assert(state.inside);
  const double x_m = xOf(state), x_cut_before_m = cuttingPosition(state, x_m);
  state.membranes_ruptured = ruptured;
  const double follow_m = cuttingPosition(state, x_m) - x_cut_before_m;
  state.wall_m += follow_m;
  state.friction_wall_m += follow_m;
  const double before_N = report.puncture_N;
  report.puncture_N = membranesForce(model, state, x_m);
  return report.puncture_N - before_N;
}

// the membrane that is closest to rupture; membrane_count if none holds
std::uint32_t nearestToRupture(const SceneModel& model, const SimState& state) {
  const double x_m = xOf(state);
  std::uint32_t nearest = model.membrane_count;
  double most = 0;
  for (std::uint32_t left = intactMembranes(state); left != 0; left &= left - 1) {
    const auto i = static_cast<std::uint32_t>(std::countr_zero(left));
    assert(i < model.membrane_count);
    const CompiledMembrane& membrane = model.membranes[i];
    const double z_m = x_m - state.membrane_place_m[i];
    const double share = z_m * (membrane.k1_N_per_m + membrane.k2_N_per_m2 * z_m) / membrane.force_N;
    if (z_m <= 0 || share <= most) continue;
    most = share;
    nearest = i;
  }
  return nearest;
}

// ruptures a membrane in the same tick as the station did; returns the change of the force along u
double takeRupture(const SceneModel& model, const StoredTick& stored, std::uint32_t ruptured_before,
                   SimState& state, StepReport& report) {
  const std::uint32_t wanted = stored.flags & kFlagRupture;
  if (!dragsWall(model) || model.membrane_count == 0 || wanted == (report.flags & kFlagRupture)) return 0.0;
  if (wanted == 0) {
    report.flags &= ~kFlagRupture;
    // membranes that opened at a hole of CUT_MEMORY stay open; those that this needle opened are forgotten
    const std::uint32_t ruptured = ruptured_before | state.cuts.opened;
    if (state.cuts.own < kMaxCutTracks)
      state.cuts.tracks[state.cuts.own].membranes &= ~(state.membranes_ruptured & ~ruptured);
    return followed(model, state, report, ruptured);
  }
  const std::uint32_t membrane = nearestToRupture(model, state);
  if (membrane == model.membrane_count) return 0.0;
  report.flags |= kFlagRupture;
  return followed(model, state, report, state.membranes_ruptured | 1u << membrane);
}

// puts the wall at its stored place; returns the change of the force along u
double takeWall(const SceneModel& model, const StoredTick& stored, SimState& state, StepReport& report) {
  if (!dragsWall(model) || !isFinite(stored.p_wall_W_m) || std::isnan(report.p_wall_W_m.x)) return 0.0;
  const double wall_m = dot(state.u_W, stored.p_wall_W_m - state.p_entry_W_m);
  if (std::fabs(wall_m - state.wall_m) <= 2 * kRounding_m) return 0.0;
  state.wall_m = wall_m;
  const double before_N = report.cutting_N + report.attracted_N;
  const double along_N =
      -model.layers[state.layer].wall_stiffness_N_per_m * (cuttingPosition(state, xOf(state)) - wall_m);
  report.cutting_N = std::min(along_N, 0.0);
  report.attracted_N = std::max(along_N, 0.0);
  return along_N - before_N;
}

// begins or ends a stop in the same tick as the station did
void takePhase(const SceneModel& model, const StoredTick& stored, SimState& state, StepReport& report) {
  if (stored.phase == state.phase || stored.phase == Phase::kFree) return;
  assert(state.inside && state.phase != Phase::kFree);
  const double x_m = xOf(state);
  const double stretch_m = std::fabs(cuttingPosition(state, x_m) - state.wall_m);
  if (stored.phase == Phase::kStopped) {
    state.stopped = true;
    state.armed = false;
    state.stop_least_m = state.wall_rest.stretch_m = stretch_m;
    const double z_m = cuttingPosition(state, x_m) - state.wall_m;
    const double rest_m = z_m > 0 ? model.layers[state.layer].rejection_stretch_m : 0.0;
    rampStep(model, state.wall_rest, std::max(0.0, stretch_m - rest_m), true);
    state.friction_rest.stretch_m = std::fabs(cuttingPosition(state, x_m) - state.friction_wall_m);
    rampStep(model, state.friction_rest, state.friction_rest.stretch_m, true);
  } else if (state.stopped) {
    state.stopped = false;
    state.armed =
        std::fabs(report.speed_mps) >= model.arming_speed_mps && state.ticks_inside >= model.speed_window;
    state.fast_tick = state.band_tick = state.ticks_inside;
    state.band_low_m = state.band_high_m = x_m - state.x_shift_m;
  }
  if (stored.phase != Phase::kStopped) state.moves_in = stored.phase == Phase::kInserting;
  state.phase = report.phase = stored.phase;
}

}  // namespace

StoredDifference differenceFrom(const StoredTick& stored, const StepReport& report) {
  StoredDifference difference;
  difference.elsewhere = stored.layer != report.layer;
  if (stored.hasEnginesForce() && isFinite(stored.force_W_N))
    difference.force_N = norm(report.wrench_W.force_N - stored.force_W_N);
  return difference;
}

StoredDifference stepAsStored(const SceneModel& model, const TipSample& sample, const StoredTick& stored,
                              SimState& state, StepReport& report) {
  const std::uint32_t ruptured_before = state.inside ? state.membranes_ruptured : 0;
  step(model, withinRounding(model, sample, stored), state, report);
  if (state.inside && stored.layer >= 0) {
    double along_N = takeRupture(model, stored, ruptured_before, state, report);
    along_N += takeWall(model, stored, state, report);
    takePhase(model, stored, state, report);
    if (along_N != 0) {
      report.wrench_W.force_N = report.wrench_W.force_N + state.u_W * along_N;
      capForce(model, report.wrench_W.force_N, report);
    }
    if (!std::isnan(report.p_wall_W_m.x)) report.p_wall_W_m = state.p_entry_W_m + state.u_W * state.wall_m;
  }
  return differenceFrom(stored, report);
}

}  // namespace needlelab
