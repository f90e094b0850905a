#include "tests/support/reference_bone.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

namespace needlelab::test {
namespace {

constexpr int kMostSlips = 8;

Vec3 nearestOnSegment(const CapsuleLimb& limb, Vec3 p_W_m) {
  const Vec3 along = limb.b_m - limb.a_m;
  const double t = std::clamp(dot(p_W_m - limb.a_m, along) / dot(along, along), 0.0, 1.0);
  return limb.a_m + along * t;
}

}  // namespace

ReferenceBone::ReferenceBone(SceneSpec scene, BoneDefect planted)
    : scene_(std::move(scene)),
      planted_(planted),
      stiffness_N_per_m_(scene_.stage_numbers[stageOf(Effect::kBone)][0]),
      friction_(scene_.stage_numbers[stageOf(Effect::kBone)][1]) {
  for (const LayerSpec& layer : scene_.layers) {
    if (layer.is_bone) break;
    top_m_ += layer.thickness_m;
  }
}

double ReferenceBone::depthInLimb(Vec3 p_W_m) const {
  if (const auto* plane = std::get_if<PlaneLimb>(&scene_.limb))
    return -dot(normalized(plane->normal), p_W_m - plane->point_m);
  if (const auto* sphere = std::get_if<SphereLimb>(&scene_.limb))
    return sphere->radius_m - norm(p_W_m - sphere->center_m);
  const auto& capsule = std::get<CapsuleLimb>(scene_.limb);
  return capsule.radius_m - norm(p_W_m - nearestOnSegment(capsule, p_W_m));
}

// "a plane with a normal of its own, through that top below the plane's point; where it would stand out of
// the skin its surface is the skin"
double ReferenceBone::depthInBone(Vec3 p_W_m) const {
  const auto* plane = std::get_if<PlaneLimb>(&scene_.limb);
  if (plane == nullptr || !scene_.bone_normal) return depthInLimb(p_W_m) - top_m_;
  const Vec3 p_top = plane->point_m - normalized(plane->normal) * top_m_;
  return std::min(-dot(normalized(*scene_.bone_normal), p_W_m - p_top), depthInLimb(p_W_m));
}

Vec3 ReferenceBone::normalAt(Vec3 p_W_m) const {
  if (const auto* plane = std::get_if<PlaneLimb>(&scene_.limb)) {
    const Vec3 skin = normalized(plane->normal);
    if (!scene_.bone_normal) return skin;
    return depthInBone(p_W_m) < depthInLimb(p_W_m) ? normalized(*scene_.bone_normal) : skin;
  }
  if (const auto* sphere = std::get_if<SphereLimb>(&scene_.limb)) return normalized(p_W_m - sphere->center_m);
  return normalized(p_W_m - nearestOnSegment(std::get<CapsuleLimb>(scene_.limb), p_W_m));
}

Vec3 ReferenceBone::ontoBone(Vec3 p_W_m) const {
  return p_W_m + normalAt(p_W_m) * depthInBone(p_W_m);
}

// where the way comes from outside into the bone: δ_b is concave along a line, because a bone is convex
std::optional<Vec3> ReferenceBone::crossing(Vec3 from_W_m, Vec3 to_W_m) const {
  const auto at = [&](double share) { return from_W_m + (to_W_m - from_W_m) * share; };
  if (depthInBone(from_W_m) > 0) return std::nullopt;
  double low = 0, high = 1;
  if (depthInBone(to_W_m) <= 0) {  // the deepest place between
    for (int i = 0; i < 200; ++i) {
      const double a = low + (high - low) / 3, b = high - (high - low) / 3;
      (depthInBone(at(a)) < depthInBone(at(b)) ? low : high) =
          depthInBone(at(a)) < depthInBone(at(b)) ? a : b;
    }
    if (depthInBone(at(low)) <= 0) return std::nullopt;
    high = low;
    low = 0;
  }
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (depthInBone(at(middle)) > 0 ? high : low) = middle;
  }
  return planted_ == BoneDefect::kNoCrossing ? ontoBone(to_W_m) : at(high);  // planted: the first
}

// 1. Proxy
void ReferenceBone::contact(Vec3 p_W_m) {
  if (p_proxy_W_m_ && (dot(normalAt(*p_proxy_W_m_), p_W_m - *p_proxy_W_m_) >= 0 || depthInLimb(p_W_m) <= 0))
    p_proxy_W_m_.reset();
  else if (!p_proxy_W_m_ && p_before_W_m_ && depthInLimb(p_W_m) > 0)
    p_proxy_W_m_ = crossing(*p_before_W_m_, p_W_m);
}

// 2. Stick and slip
void ReferenceBone::slip(Vec3 p_W_m) {
  if (planted_ == BoneDefect::kSticks) return;                         // planted
  const int most = planted_ == BoneDefect::kOneSlip ? 1 : kMostSlips;  // planted: the first
  for (int i = 0; i < most; ++i) {
    const Vec3 q = *p_proxy_W_m_, n = normalAt(q);
    const double g = -dot(n, p_W_m - q);
    const Vec3 aside = (p_W_m - q) + n * g;
    const double t = norm(aside), beyond = t - friction_ * std::max(0.0, g);
    if (!(g > 0) || !(beyond > 0)) return;
    double move = planted_ == BoneDefect::kSlipsToFoot ? t : beyond;  // planted: the first
    Vec3 to = ontoBone(q + aside * (move / t));
    if (norm(to - p_W_m) > norm(q - p_W_m)) to = ontoBone(q + aside * (0.5 * move / t));
    if (norm(to - p_W_m) > norm(q - p_W_m)) return;
    p_proxy_W_m_ = to;
  }
}

ReferenceBone::Stand ReferenceBone::step(Vec3 p_W_m, const std::optional<BoneTissue>& tissue) {
  contact(p_W_m);
  Stand stand;
  stand.p_felt_W_m = p_W_m;
  if (p_proxy_W_m_) {
    slip(p_W_m);
    const Vec3 q = *p_proxy_W_m_;
    stand.touching = true;
    stand.p_proxy_W_m = q;
    stand.force_W_N = (q - p_W_m) * stiffness_N_per_m_;  // 3. Force
    if (tissue && planted_ != BoneDefect::kTipInBone) {  // 4. Tissue; else planted
      const double held_at =
          std::max({dot(tissue->u_W, q - tissue->p_entry_W_m), tissue->wall, tissue->friction_wall});
      stand.held_m = std::max(0.0, dot(tissue->u_W, p_W_m - tissue->p_entry_W_m) - held_at);
      stand.held_m = std::min(stand.held_m, 0.9 * depthInLimb(p_W_m));
      stand.p_felt_W_m = p_W_m - tissue->u_W * stand.held_m;
    }
  }
  p_before_W_m_ = p_W_m;
  return stand;
}

}  // namespace needlelab::test
