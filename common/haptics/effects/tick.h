/// What one tick derives before the effects run, and what they leave behind. Lives on the stack of `step`.
#pragma once

#include "haptics/engine.h"

namespace needlelab {

struct Tick {
  Vec3 p_W_m;              ///< tip
  Vec3 axis_W;             ///< needle's axis, unit
  double depth_m = 0;      ///< δ
  Vec3 arm_W_m;            ///< p − P0
  double x_m = 0;          ///< u·(p − P0)
  double insertion_m = 0;  ///< d_t
  Vec3 lateral_W_m;        ///< e
  double lateral_m = 0;    ///< |e|
  double speed_mps = 0;    ///< v
  double x_cut_m = 0;      ///< x_c: nothing is cut or rubbed beyond a membrane that holds
};

/// min(max(0, x), δ/c)
inline double insertionOf(double x_m, double depth_m, double inverse_slant) {
  const double along = x_m > 0.0 ? x_m : 0.0;
  const double through = depth_m * inverse_slant;
  return along < through ? along : through;
}

/// Takes x, d_t and e anew from the present u.
inline void project(const SimState& state, Tick& tick) {
  tick.x_m = dot(state.u_W, tick.arm_W_m);
  tick.insertion_m = insertionOf(tick.x_m, tick.depth_m, state.inverse_slant);
  tick.lateral_W_m = tick.arm_W_m - state.u_W * tick.x_m;
  tick.lateral_m = norm(tick.lateral_W_m);
}

/// The layer that holds a depth along the normal; `index` is where to look first. Half-open [top, bottom).
inline std::uint32_t layerAt(const SceneModel& model, double depth_m, std::uint32_t index) {
  while (index + 1 < model.layer_count && depth_m >= model.layers[index + 1].top_m) ++index;
  while (index > 0 && depth_m < model.layers[index].top_m) --index;
  return index;
}

/// Angle between two unit vectors, by atan2 (DESIGN §3). In [0, π].
double angleBetween(Vec3 a, Vec3 b) noexcept;

}  // namespace needlelab
