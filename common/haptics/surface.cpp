#include "common/haptics/surface.h"

#include <algorithm>

namespace needlelab {

Vec3 surfaceNormal(const Limb& limb, Vec3 p, Vec3 motion) noexcept {
  Vec3 out;
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) {
    return plane->normal;
  } else if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    out = p - sphere->center_m;
  } else {
    const auto& capsule = *std::get_if<CapsuleLimb>(&limb);
    const Vec3 ab = capsule.b_m - capsule.a_m;
    const double t = std::clamp(dot(p - capsule.a_m, ab) / normSquared(ab), 0.0, 1.0);
    out = p - (capsule.a_m + ab * t);
  }
  const double size = norm(out);
  return size > 1e-12 ? out / size : -normalized(motion);
}

Vec3 entryPoint(const SimState& before, Vec3 p_W_m, double depth_m) noexcept {
  const double share = before.depth_prev_m / (before.depth_prev_m - depth_m);
  return before.p_prev_W_m + (p_W_m - before.p_prev_W_m) * share;
}

}  // namespace needlelab
