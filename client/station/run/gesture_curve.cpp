#include "client/station/run/gesture_curve.h"

#include <algorithm>
#include <cmath>

#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

double forceIn(const GestureSample& s) {
  return std::hypot(s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]);
}

bool isFinitePoint(const GestureSample& s) {
  return std::isfinite(s.p_WT_m[0] + s.p_WT_m[1] + s.p_WT_m[2] + forceIn(s) + s.insertion_m +
                       s.lateral_error_m + s.speed_mps);
}

}  // namespace

GestureCurve gestureCurve(std::span<const GestureSample> samples, const Limb& limb_W,
                          std::size_t most_points) {
  GestureCurve curve;
  if (samples.empty() || most_points == 0) return curve;
  const std::size_t group = (samples.size() + most_points - 1) / most_points;
  curve.reserve((samples.size() + group - 1) / group);
  for (std::size_t begin = 0; begin < samples.size(); begin += group) {
    const GestureSample* strongest = nullptr;
    for (const GestureSample& s : samples.subspan(begin, std::min(group, samples.size() - begin)))
      if (isFinitePoint(s) && (strongest == nullptr || forceIn(s) > forceIn(*strongest))) strongest = &s;
    if (strongest == nullptr) continue;
    const GestureSample& s = *strongest;
    const double depth = signedDepth(limb_W, {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]});
    curve.push_back({static_cast<float>(1e-9 * static_cast<double>(s.time_ns - samples.front().time_ns)),
                     static_cast<float>(depth), static_cast<float>(s.insertion_m),
                     static_cast<float>(forceIn(s)), static_cast<float>(s.lateral_error_m),
                     static_cast<float>(s.speed_mps)});
  }
  return curve;
}

}  // namespace needlelab
