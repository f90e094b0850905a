#include "common/haptics/surface.h"

#include <algorithm>
#include <cassert>

#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

double depthIn(const PlaneLimb& plane, Vec3 p) {
  return -dot(plane.normal, p - plane.point_m);
}
double depthIn(const SphereLimb& sphere, Vec3 p) {
  return sphere.radius_m - norm(p - sphere.center_m);
}
double depthIn(const CapsuleLimb& capsule, Vec3 p) {
  const Vec3 ab = capsule.b_m - capsule.a_m;
  const double t = std::clamp(dot(p - capsule.a_m, ab) / normSquared(ab), 0.0, 1.0);
  return capsule.radius_m - norm(p - (capsule.a_m + ab * t));
}
double depthIn(const BodyLimb& limb, Vec3 p) {
  return limb.body->depth(inverse(limb.X_WL) * p);
}

}  // namespace

Limb placed(const Limb& limb, const Pose& X_WL) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) {
    return PlaneLimb{X_WL * plane->point_m, rotate(X_WL.q, plane->normal)};
  }
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    return SphereLimb{X_WL * sphere->center_m, sphere->radius_m};
  }
  if (const auto* body = std::get_if<BodyLimb>(&limb)) return BodyLimb{body->body, X_WL * body->X_WL};
  const auto& capsule = std::get<CapsuleLimb>(limb);
  return CapsuleLimb{X_WL * capsule.a_m, X_WL * capsule.b_m, capsule.radius_m};
}

double depthInLimb(const SceneModel& model, const Vec3& p_W_m) noexcept {
  return signedDepth(model.limb, p_W_m);
}

double signedDepth(const Limb& limb, Vec3 p_W_m) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return depthIn(*plane, p_W_m);
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) return depthIn(*sphere, p_W_m);
  if (const auto* body = std::get_if<BodyLimb>(&limb)) return depthIn(*body, p_W_m);
  return depthIn(*std::get_if<CapsuleLimb>(&limb), p_W_m);
}

Vec3 surfaceNormal(const Limb& limb, Vec3 p, Vec3 motion) noexcept {
  Vec3 out;
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) {
    return plane->normal;
  } else if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    out = p - sphere->center_m;
  } else if (const auto* body = std::get_if<BodyLimb>(&limb)) {
    out = rotate(body->X_WL.q, body->body->normal(inverse(body->X_WL) * p));
  } else {
    const auto& capsule = *std::get_if<CapsuleLimb>(&limb);
    const Vec3 ab = capsule.b_m - capsule.a_m;
    const double t = std::clamp(dot(p - capsule.a_m, ab) / normSquared(ab), 0.0, 1.0);
    out = p - (capsule.a_m + ab * t);
  }
  const double size = norm(out);
  return size > 1e-12 ? out / size : -normalized(motion);
}

Vec3 nearestSkin(const Limb& limb, Vec3 p, Vec3 motion) noexcept {
  constexpr int kSkinSteps = 8;
  constexpr double kOnSkin_m = 1e-9;
  Vec3 at = p + surfaceNormal(limb, p, motion) * signedDepth(limb, p);
  if (!std::holds_alternative<BodyLimb>(limb)) return at;
  for (int step = 0; step < kSkinSteps; ++step) {
    const double depth_m = signedDepth(limb, at);
    if (!(depth_m > kOnSkin_m || depth_m < -kOnSkin_m)) break;
    at = at + surfaceNormal(limb, at, motion) * depth_m;
  }
  return at;
}

double depthBelowSkin(const Limb& limb, Vec3 p) noexcept {
  const double depth_m = signedDepth(limb, p);
  if (!std::holds_alternative<BodyLimb>(limb) || !(depth_m > 0)) return depth_m;
  return norm(p - nearestSkin(limb, p, {0, 0, -1}));
}

BonesNear bonesNear(const BodyLimb& limb, Vec3 p_W_m, double within_m) noexcept {
  BonesNear near = limb.body->bonesNear(inverse(limb.X_WL) * p_W_m, within_m);
  for (std::size_t i = 0; i < near.count; ++i) {
    near.planes[i].point_m = limb.X_WL * near.planes[i].point_m;
    near.planes[i].normal = rotate(limb.X_WL.q, near.planes[i].normal);
  }
  return near;
}

Vec3 entryPoint(const SimState& before, Vec3 p_W_m, double depth_m) noexcept {
  assert(!(before.depth_prev_m > 0.0) && depth_m > 0.0);
  const double share = before.depth_prev_m / (before.depth_prev_m - depth_m);
  return before.p_prev_W_m + (p_W_m - before.p_prev_W_m) * share;
}

}  // namespace needlelab
