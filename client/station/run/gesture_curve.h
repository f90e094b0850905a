/// A gesture on few points, for the plots after a lesson.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Of some ticks in a row: the one with the greatest force stands for them, so that no peak is lost.
struct CurvePoint {
  float time_s = 0;   ///< since the first sample
  float depth_m = 0;  ///< δ, negative outside
  float insertion_m = 0;
  float force_N = 0;  ///< |force| on the hand
  float lateral_error_m = 0;
  float speed_mps = 0;
};
using GestureCurve = std::vector<CurvePoint>;

/// At most `most_points` (at least 1), evenly over the samples; those that are not finite are left out.
/// `limb_W`: a plane's normal is a unit vector.
GestureCurve gestureCurve(std::span<const GestureSample> samples, const Limb& limb_W,
                          std::size_t most_points = 4000);

}  // namespace needlelab
