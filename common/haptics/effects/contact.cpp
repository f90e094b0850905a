#include "common/haptics/tick.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "common/haptics/det_math.h"
#include "common/haptics/effects/trajectory.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

// sets P0, n, u and the state of the insertion to their initial values; `state` still holds the previous
// tick. Returns the entry's flags
std::uint32_t beginInsertion(const SceneModel& model, SimState& state, const TipSample& sample,
                             double depth_m) {
  assert(state.outside_once && !state.inside);
  const Vec3 axis = unitAxis(sample);
  const Vec3 motion = sample.p_WT_m - state.p_prev_W_m;
  state.inside = true;
  state.past_middle = false;
  state.p_entry_W_m = state.p_hole_W_m = entryPoint(state, sample.p_WT_m, depth_m);
  state.normal_W = surfaceNormal(model.limb, state.p_entry_W_m, motion);
  state.u_W = state.u0_W = entryDirection(axis, state.normal_W);
  state.aim_W = axis;
  ++state.line_changes;
  assert(isUnit(state.normal_W) && isUnit(state.u_W));
  state.slant = std::max(0.05, -dot(state.normal_W, state.u_W));
  state.inverse_slant = 1.0 / state.slant;
  layLayers(model, state.p_entry_W_m, state.u_W, state.slant, state.along);
  state.layer = 0;
  state.phase = Phase::kInserting;

  state.ticks_inside = 0;
  state.x_shift_m = 0.0;
  state.history_mask = model.history_mask;
  state.x_history_m[0] = 0.0;
  // a tip that enters backwards along u is not pulled further
  state.wall_m = state.friction_wall_m = std::min(0.0, dot(state.u_W, sample.p_WT_m - state.p_entry_W_m));
  state.wall_stiffness_N_per_m = model.layers[0].wall_stiffness_N_per_m;
  state.band_low_m = state.band_high_m = 0.0;
  state.band_tick = state.fast_tick = state.across_tick = 0;
  state.across_from_W_m = sample.p_WT_m;
  state.moves_in = true;
  state.armed = state.stopped = false;
  state.stop_least_m = 0.0;
  state.wall_rest = state.friction_rest = {};
  state.membranes_met = state.membranes_ruptured = 0;
  ++state.insertions;
  state.table_row = 0;
  state.score.cell = -1;
  state.proxy_held = true;  // on the skin
  state.proxy_layer = state.tops_met = 0;
  state.slid_m = 0.0;
  state.tilt_limit_is_cone = false;
  state.tilt_limit_insertion_m = 0.0;
  if (model.isLive(Effect::kOrientationLimit))
    state.tilt_limit_rad = std::max(kPi / 4, angleBetween(axis, state.u_W));
  return std::fabs(dot(axis, state.normal_W)) < kCos80Degrees ? kFlagEntry | kFlagFlatEntry : kFlagEntry;
}

// true if the tip left a round limb on its far side: the needle is through. The insertion lasts until the tip
// is back in the limb, or on P0's side of the tangent plane to the skin there
bool isThrough(const SimState& state, const TipSample& sample, double depth_m, bool was_in_limb) {
  const Vec3 arm = sample.p_WT_m - state.p_entry_W_m;
  const double below_m = -dot(state.normal_W, arm);
  if (!state.inside || depth_m > 0.0 || !(below_m > 0.0)) return false;
  if (!was_in_limb) return true;
  const bool far = state.past_middle || dot(state.u_W, arm) >= state.along.deepest_m;
  return far && below_m - depth_m > kSameSide_m;
}

}  // namespace

void clearReport(StepReport& report, double depth_m, std::uint32_t flags) noexcept {
  report.wrench_W = {};
  report.p_wall_W_m = {kNoNumber, kNoNumber, kNoNumber};
  report.phase = Phase::kFree;
  report.layer = -1;
  report.depth_m = depth_m;
  report.insertion_m = report.speed_mps = report.lateral_error_m = 0.0;
  report.cutting_N = report.attracted_N = report.friction_N = report.puncture_N = 0.0;
  report.clamping_N = report.clamping_stiffness_N_per_m = 0.0;
  report.flags = flags;
}

bool changeContact(const SceneModel& model, const TipSample& sample, double depth_m, SimState& state,
                   StepReport& report) noexcept {
  if (!isFinite(sample)) {
    clearReport(report, 0.0, kFlagNotStepped);
    return false;
  }
  bool in_tissue = false;
  const bool was_in_limb = state.in_limb;
  state.in_limb = depth_m > 0.0;
  if (isThrough(state, sample, depth_m, was_in_limb)) {
    in_tissue = true;
    report.flags = was_in_limb ? kFlagLayerChange : 0u;
    state.layer = 0;
  } else if (!(depth_m > 0.0)) {
    clearReport(report, depth_m, state.inside ? kFlagExit : 0u);
    state.inside = false;
    state.phase = Phase::kFree;
    state.outside_once = true;
  } else if (!state.outside_once) {
    state.in_limb = false;
    clearReport(report, depth_m, kFlagStartedInside);
  } else {
    in_tissue = true;
    report.flags = state.inside ? 0u : beginInsertion(model, state, sample, depth_m);
    const std::uint32_t layer = findLayer(model, depth_m, state.layer);
    if (layer != state.layer && report.flags == 0) report.flags = kFlagLayerChange;
    state.layer = layer;
  }
  if (!in_tissue) {
    state.p_prev_W_m = sample.p_WT_m;
    state.depth_prev_m = depth_m;
  }
  state.has_prev = true;
  return in_tissue;
}

double orientationLimitAngle(double needle_length_m, double insertion_m) {
  assert(!(needle_length_m < 0.0));
  const double d = std::clamp(insertion_m, 0.0, needle_length_m);
  return detAtan2(needle_length_m - d, needle_length_m + d);
}

double angleBetween(Vec3 a, Vec3 b) noexcept {
  assert(isUnit(a) && isUnit(b));
  return detAtan2(norm(cross(a, b)), dot(a, b));
}

std::uint32_t findLayer(const SceneModel& model, double depth_m, std::uint32_t index) noexcept {
  assert(index < model.layer_count);
  while (index + 1 < model.layer_count && depth_m >= model.layers[index + 1].top_m) ++index;
  while (index > 0 && depth_m < model.layers[index].top_m) --index;
  return index;
}

}  // namespace needlelab
