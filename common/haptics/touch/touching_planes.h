/// Bones near a place as the planes that touch them: a surface for a proxy (proxy_contact.h). Where several
/// meet, the proxy slips along the edge between them.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <span>

#include "common/haptics/body.h"
#include "common/haptics/touch/proxy_contact.h"

namespace needlelab::proxy_contact {

/// Half-spaces, at least one. The planes must outlive it.
struct TouchingPlanes {
  std::span<const BonePlane> planes;
  static constexpr bool kIsConvex = false;

  static double below(const BonePlane& plane, Vec3 p_W_m) {
    return -dot(plane.normal, p_W_m - plane.point_m);
  }

  /// The plane that a place is deepest in.
  [[nodiscard]] const BonePlane& deepestAt(Vec3 p_W_m) const {
    assert(!planes.empty());
    const BonePlane* deepest = &planes[0];
    for (const BonePlane& plane : planes.subspan(1))
      if (below(plane, p_W_m) > below(*deepest, p_W_m)) deepest = &plane;
    return *deepest;
  }

  [[nodiscard]] double depth(Vec3 p_W_m) const { return below(deepestAt(p_W_m), p_W_m); }
  [[nodiscard]] Vec3 normal(Vec3 p_W_m, Vec3 /*motion*/) const { return deepestAt(p_W_m).normal; }
  [[nodiscard]] Rest rest(Vec3 proxy_W_m, Vec3 to_tip) const {
    return restFrom(normal(proxy_W_m, to_tip), proxy_W_m, to_tip);
  }

  /// What the proxy lies on; `normal_W` if it lies on no plane.
  [[nodiscard]] Rest restFrom(Vec3 normal_W, Vec3 proxy_W_m, Vec3 to_tip) const {
    Rest found{normal_W, false, {}};
    // on several bones: the one that the tip presses most
    double most_m = -std::numeric_limits<double>::infinity();
    for (const BonePlane& plane : planes) {
      if (below(plane, proxy_W_m) < -kOnSurface_m || -dot(plane.normal, to_tip) <= most_m) continue;
      most_m = -dot(plane.normal, to_tip);
      found.normal = plane.normal;
    }
    const Vec3 along = to_tip + found.normal * std::max(0.0, -dot(found.normal, to_tip));
    for (const BonePlane& plane : planes) {
      if (below(plane, proxy_W_m) < -kOnSurface_m || !(dot(plane.normal, along) < 0.0)) continue;
      const Vec3 edge = cross(found.normal, plane.normal);
      const double size = norm(edge);
      if (!(size > 1e-6)) continue;
      found.on_edge = true;
      found.edge = edge / size;
    }
    return found;
  }

  /// Only planes that the proxy is outside of clip it: it does not enter one, but a plane that came over it
  /// may hold it.
  [[nodiscard]] Vec3 clipped(Vec3 proxy_W_m, Vec3 step) const {
    double share = 1.0;
    for (const BonePlane& plane : planes) {
      const double from_m = below(plane, proxy_W_m);
      const double to_m = below(plane, proxy_W_m + step);
      if (from_m > kOnSurface_m || to_m <= kOnSurface_m) continue;
      share = std::min(share, std::max(0.0, -from_m) / (to_m - from_m));
    }
    return step * share;
  }
};

}  // namespace needlelab::proxy_contact
