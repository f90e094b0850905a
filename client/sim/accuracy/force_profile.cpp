#include "client/sim/accuracy/force_profile.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

ForceProfile::ForceProfile(const SceneSpec& spec, double rate_hz) : spec_(spec), period_s_(1 / rate_hz) {}

const LayerSpec& ForceProfile::layerAt(double depth_m) const {
  double top_m = 0;
  for (const LayerSpec& layer : spec_.layers) {
    top_m += layer.thickness_m;
    if (depth_m < top_m) return layer;
  }
  return spec_.layers.back();
}

double ForceProfile::atRest(double depth_m) const {
  const TrackingWallSpec& wall = spec_.tracking_wall;
  const double from_N = std::abs(moving_N_), to_N = std::min(from_N, layerAt(depth_m).rejection_force_N);
  const double t_s = rest_s_ - wall.stop_dwell_s;
  double force_N = from_N;
  if (t_s > 0 && wall.stop_mode == StopMode::kRamp)
    force_N = std::max(to_N, from_N - (from_N - to_N) * t_s / wall.stop_duration_s);
  if (t_s > 0 && wall.stop_mode == StopMode::kExponential) {
    const double left_N = std::max(to_N, wall.relax_residual * from_N);
    force_N = left_N + (from_N - left_N) * std::exp(-t_s / wall.relax_time_s);
  }
  return std::copysign(force_N, moving_N_);
}

double ForceProfile::next(double depth_m, Intent intent) {
  if (depth_m <= 0) {
    moving_N_ = rest_s_ = 0;
    return 0;
  }
  if (intent == Intent::kRest) {
    rest_s_ += period_s_;
    return atRest(depth_m);
  }
  rest_s_ = 0;
  const LayerSpec& layer = layerAt(depth_m);
  const auto live = [&](Effect effect) { return (spec_.effects & bitOf(effect)) != 0; };
  if (intent == Intent::kIn)
    moving_N_ = live(Effect::kCutting) ? -layer.cutting_force_N : 0;
  else
    moving_N_ = live(Effect::kAttracted) ? layer.attracted_force_N : 0;
  return moving_N_;
}

}  // namespace needlelab
