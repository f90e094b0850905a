/// The bones of a body as a surface for a proxy (proxy_contact.h), of any form. Real-time safe.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/haptics/scene_model.h"
#include "common/haptics/touch/proxy_contact.h"

namespace needlelab::proxy_contact {

/// All places that are `above_m` off the bones, which have `distance` and `slope`, as Bones has.
template <class Bones>
struct OnBones {
  Bones bones;
  double above_m = 0;
  static constexpr bool kIsConvex = false;
  /// A way is looked at in at most so many steps, …
  static constexpr int kSteps = 64;
  /// … none shorter than this: less bone than that may be missed.
  static constexpr double kLeast_m = 2e-6;
  static constexpr int kHalvings = 24, kNewtons = 4;
  static constexpr double kOn_m = kOnSurface_m, kStill_m = 1e-8;

  [[nodiscard]] double away(Vec3 p_W_m) const { return bones.distance(p_W_m) - above_m; }
  [[nodiscard]] double depth(Vec3 p_W_m) const { return -away(p_W_m); }
  [[nodiscard]] Vec3 normal(Vec3 p_W_m, Vec3 motion) const {
    const Vec3 slope = bones.slope(p_W_m);
    const double size = norm(slope);
    if (size > 0.0) return slope / size;
    return norm(motion) > 0.0 ? normalized(-motion) : Vec3{0, 0, 1};
  }

  /// A place on the surface near a place.
  [[nodiscard]] Vec3 onto(Vec3 p_W_m) const {
    for (int i = 0; i < kNewtons; ++i) {
      const double away_m = away(p_W_m);
      if (std::fabs(away_m) <= kOn_m) break;
      const Vec3 slope = bones.slope(p_W_m);
      const double size2 = normSquared(slope);
      if (!(size2 > 0.0)) break;
      p_W_m = p_W_m - slope * (away_m / size2);
    }
    return p_W_m;
  }

  /// Whether the straight way from a place outside meets the surface, and where: the last place outside.
  /// Where `begins_on` says that the way begins on the surface, it is not met there.
  [[nodiscard]] bool meets(Vec3 from_W_m, Vec3 to_W_m, bool begins_on, Vec3& at_W_m) const {
    const Vec3 way = to_W_m - from_W_m;
    const double length_m = norm(way), least_m = std::max(kLeast_m, length_m / kSteps);
    double gone_m = 0.0, away_m = away(from_W_m);
    at_W_m = from_W_m;
    if (away_m < 0.0 && !begins_on) return true;
    while (gone_m < length_m) {
      const double next_m = std::min(length_m, gone_m + std::max(away_m / kMostSteep, least_m));
      away_m = away(from_W_m + way * (next_m / length_m));
      if (away_m < 0.0) {
        double in_m = next_m;
        for (int i = 0; i < kHalvings; ++i) {
          const double middle_m = 0.5 * (gone_m + in_m);
          (away(from_W_m + way * (middle_m / length_m)) < 0.0 ? in_m : gone_m) = middle_m;
        }
        at_W_m = from_W_m + way * (gone_m / length_m);
        return true;
      }
      gone_m = next_m;
    }
    at_W_m = to_W_m;
    return false;
  }

  /// Whether a proxy may go from one place to another beside this tip.
  [[nodiscard]] bool reaches(Vec3 /*from_W_m*/, Vec3 /*to_W_m*/, Vec3 /*tip_W_m*/) const { return true; }
};

}  // namespace needlelab::proxy_contact
