/// Values that a tick derives before the effects run, and the results of the effects. Lives on the stack of
/// `step`.
#pragma once

#include <cassert>
#include <cmath>
#include <limits>

#include "common/haptics/engine.h"

namespace needlelab {

struct Tick {
  double depth_m = 0;                    ///< δ
  const CompiledLayer* layer = nullptr;  ///< the tip's layer; model.beyond on the other side of the limb
  double x_m = 0;                        ///< u·(p − P0)
  Vec3 arm_W_m;                          ///< p − P0
  double insertion_m = 0;                ///< d_t = |p − P0|
  double inverse_insertion_per_m = 0;    ///< 1/d_t; NaN at P0
  Vec3 lateral_W_m;                      ///< e
  double lateral_m = 0;                  ///< |e|
  double speed_mps = 0;                  ///< v
  double x_cut_m = 0;                    ///< x_c: no cutting or friction beyond an intact membrane
};

/// The needle's axis for all code except the quick test of the cone.
inline Vec3 unitAxis(const TipSample& sample) {
  return normalized(zAxis(sample.q_WT));
}

inline bool isFinite(const TipSample& sample) {
  return isFinite(sample.p_WT_m) && isFinite(sample.q_WT);
}

/// δ of a point: inline for the half-space, out of line for other limbs.
[[gnu::always_inline]] inline double depthIn(const SceneModel& model, const Vec3& p_W_m) {
  if (model.is_plane) return -dot(model.plane_normal, p_W_m - model.plane_point_m);
  return depthInLimb(model, p_W_m);
}

/// Computes x, d_t and e from the current P0 and u.
[[gnu::always_inline]] inline void project(const SimState& state, Vec3 p_W_m, Tick& tick) {
  tick.arm_W_m = p_W_m - state.p_entry_W_m;
  tick.x_m = dot(state.u_W, tick.arm_W_m);
  const double squared_m2 = normSquared(tick.arm_W_m);
  tick.insertion_m = std::sqrt(squared_m2);
  // compute root and division in parallel, not in sequence
  tick.inverse_insertion_per_m = tick.insertion_m * (1.0 / squared_m2);
  tick.lateral_W_m = tick.arm_W_m - state.u_W * tick.x_m;
  tick.lateral_m = norm(tick.lateral_W_m);
}

/// h: how far the tip is below the plane that touches the skin at P0.
[[gnu::always_inline]] inline double heightOf(const SceneModel& model, const SimState& state,
                                              const Tick& tick) {
  return model.is_plane ? tick.depth_m : -dot(state.normal_W, tick.arm_W_m);
}

/// Returns the layer at a depth along the normal; `index` is the start of the search.
std::uint32_t findLayer(const SceneModel& model, double depth_m, std::uint32_t index) noexcept;

/// Returns the span of the layers along u at an inserted length; cached from tick to tick.
[[gnu::always_inline]] inline const LayerSpan& spanAt(SimState& state, double insertion_m) {
  LayersAlong& along = state.along;
  while (insertion_m >= along.spans[along.at].end_m) [[unlikely]]++ along.at;
  while (insertion_m < along.spans[along.at].begin_m) [[unlikely]]-- along.at;
  assert(along.at < along.count);
  return along.spans[along.at];
}

/// Angle between two unit vectors, by atan2. In [0, π].
double angleBetween(Vec3 a, Vec3 b) noexcept;

/// Limits a force to max_force_N and keeps its direction.
inline void capForce(const SceneModel& model, Vec3& force_N, StepReport& report) {
  const double squared = normSquared(force_N);
  if (!(squared > model.max_force_N * model.max_force_N)) return;
  force_N = force_N * (model.max_force_N / std::sqrt(squared));
  report.flags |= kFlagForceCapped;
}

// ---- start and end of an insertion (FORCE_MODEL.md, "Contact"): rare, hence out of line ----

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

/// The report of a tick without force.
void clearReport(StepReport& report, double depth_m, std::uint32_t flags) noexcept;

/// Handles a tick that does not begin and end in the same layer (outside, an entry, an exit, another layer),
/// or a sample that is not finite. Returns true in tissue: it has set the report's flags, and at an entry P0,
/// n, u and the whole state of the insertion; the tick continues as usual. Returns false when this tick has
/// no force; then the report is complete.
bool changeContact(const SceneModel& model, const TipSample& sample, double depth_m, SimState& state,
                   StepReport& report) noexcept;

/// The tip's place in the previous tick, for axial models that interpolate or differentiate.
struct TickBefore {
  double x_m = 0;      ///< along the current u
  double depth_m = 0;  ///< δ
};

/// At the entry tick P0: x = 0 and δ = 0 (FORCE_MODEL.md, "Puncture").
inline TickBefore tickBefore(const SimState& state) {
  assert(state.inside && state.ticks_inside > 0);
  if (state.ticks_inside == 1) return {};
  return {state.x_history_m[(state.ticks_inside - 1) & state.history_mask] + state.x_shift_m,
          state.depth_prev_m};
}

}  // namespace needlelab
