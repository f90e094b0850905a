#include "common/scoring/anatomy/structure_region.h"

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

/// A shaft is looked at in steps of at least this.
constexpr double kShaftStep_m = 1e-4;
/// A slope is taken over twice this; a surface is found to kOnSurface_m.
constexpr double kSlope_m = 2e-5, kOnSurface_m = 1e-7;
constexpr int kMostSteps = 40;

}  // namespace

double StructureRegion::distanceFromShaft(Vec3 tip_W_m, Vec3 skin_W_m) const noexcept {
  const double length_m = norm(skin_W_m - tip_W_m);
  double least_m = distance(tip_W_m), along_m = 0, here_m = least_m;
  while (least_m > 0 && along_m < length_m) {
    along_m = std::min(length_m, along_m + std::max(here_m / kMostSteep, kShaftStep_m));
    here_m = distance(tip_W_m + (skin_W_m - tip_W_m) * (along_m / length_m));
    least_m = std::min(least_m, here_m);
  }
  return least_m;
}

Vec3 StructureRegion::nearest(Vec3 p_W_m) const noexcept {
  Vec3 at_W_m = p_W_m;
  double from_m = distance(at_W_m);
  for (int step = 0; step < kMostSteps && std::fabs(from_m) > kOnSurface_m; ++step) {
    const auto slope = [&](Vec3 by) { return distance(at_W_m + by) - distance(at_W_m - by); };
    const Vec3 up{slope({kSlope_m, 0, 0}), slope({0, kSlope_m, 0}), slope({0, 0, kSlope_m})};
    const double size = norm(up);
    if (!(size > 1e-9 * kSlope_m)) break;
    at_W_m = at_W_m - up * (from_m / size);
    from_m = distance(at_W_m);
  }
  return at_W_m;
}

}  // namespace needlelab
