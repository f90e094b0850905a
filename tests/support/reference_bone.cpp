#include "tests/support/reference_bone.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

namespace needlelab::test {
namespace {

constexpr int kMostSlips = 8, kWaySteps = 64;

Vec3 nearestOnAxis(const CapsuleLimb& limb, Vec3 p_W_m) {
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
  return capsule.radius_m - norm(p_W_m - nearestOnAxis(capsule, p_W_m));
}

// "a plane with a normal of its own, through that top below the plane's point"
double ReferenceBone::belowPlane(Vec3 p_W_m) const {
  const auto& plane = std::get<PlaneLimb>(scene_.limb);
  const Vec3 p_top = plane.point_m - normalized(plane.normal) * top_m_;
  return -dot(normalized(scene_.bone_normal.value_or(plane.normal)), p_W_m - p_top);
}

// "where it would stand out of the skin its surface is the skin"
double ReferenceBone::depthInBone(Vec3 p_W_m) const {
  if (std::holds_alternative<PlaneLimb>(scene_.limb)) return std::min(belowPlane(p_W_m), depthInLimb(p_W_m));
  return depthInLimb(p_W_m) - top_m_;
}

Vec3 ReferenceBone::normalAt(Vec3 p_W_m) const {
  if (const auto* plane = std::get_if<PlaneLimb>(&scene_.limb)) {
    const Vec3 skin = normalized(plane->normal);
    return belowPlane(p_W_m) <= depthInLimb(p_W_m) ? normalized(scene_.bone_normal.value_or(skin)) : skin;
  }
  if (const auto* sphere = std::get_if<SphereLimb>(&scene_.limb)) return normalized(p_W_m - sphere->center_m);
  return normalized(p_W_m - nearestOnAxis(std::get<CapsuleLimb>(scene_.limb), p_W_m));
}

Vec3 ReferenceBone::ontoBone(Vec3 p_W_m) const {
  return p_W_m + normalAt(p_W_m) * depthInBone(p_W_m);
}

// The place where the way meets the bone. The page says "where the way meets δ_b = 0"; on a round bone the
// engine walks: each time by the distance to the bone, and by a 64th of the way at least, until it is in it
std::optional<Vec3> ReferenceBone::meeting(Vec3 from_W_m, Vec3 to_W_m) const {
  const Vec3 way = to_W_m - from_W_m;
  if (std::holds_alternative<PlaneLimb>(scene_.limb)) {
    const double from = std::min(0.0, belowPlane(from_W_m)), to = belowPlane(to_W_m);
    if (!(to > 0)) return std::nullopt;
    return from_W_m + way * (from / (from - to));
  }
  const double length = norm(way);
  double gone = std::max(0.0, -depthInBone(from_W_m));
  for (int i = 0; i < kWaySteps && gone < length; ++i) {
    const Vec3 at = from_W_m + way * (gone / length);
    if (depthInBone(at) > 0) return at;
    gone += std::max(-depthInBone(at), length / kWaySteps);
  }
  return depthInBone(to_W_m) > 0 ? std::optional(to_W_m) : std::nullopt;
}

// 1. Proxy; a proxy that was there stays to be looked at by `slip`
void ReferenceBone::contact(Vec3 p_W_m) {
  if (p_proxy_W_m_ || !p_before_W_m_) return;
  p_proxy_W_m_ = meeting(*p_before_W_m_, p_W_m);
  if (planted_ == BoneDefect::kBeginsAtTip && p_proxy_W_m_) p_proxy_W_m_ = p_W_m;  // planted
  if (p_proxy_W_m_) p_proxy_W_m_ = ontoBone(*p_proxy_W_m_);
}

// 2. Stick and slip; ends the contact where the tip is outside the plane that touches the bone at q
void ReferenceBone::slip(Vec3 p_W_m) {
  const int most = planted_ == BoneDefect::kOneSlip ? 1 : kMostSlips;  // planted: the first
  for (int i = 0;; ++i) {
    const Vec3 q = *p_proxy_W_m_, n = normalAt(q);
    const double g = -dot(n, p_W_m - q);
    if (!(g > 0)) return p_proxy_W_m_.reset();
    const Vec3 aside = (p_W_m - q) + n * g;
    const double t = norm(aside);
    if (t <= friction_ * g || i == most || planted_ == BoneDefect::kSticks) return;    // planted: the last
    const double move = planted_ == BoneDefect::kSlipsToFoot ? t : t - friction_ * g;  // planted: the first
    // "A move that would lengthen |q − p| is halved or left out": halved up to four times
    std::optional<Vec3> next;
    for (double share = 1; share >= 1.0 / 16 && !next; share /= 2) {
      const Vec3 to = ontoBone(q + aside * (share * move / t));
      if (norm(to - p_W_m) < norm(q - p_W_m)) next = to;
    }
    if (!next) return;
    p_proxy_W_m_ = next;
  }
}

ReferenceBone::Stand ReferenceBone::step(Vec3 p_W_m, const std::optional<BoneTissue>& tissue) {
  Stand stand;
  stand.p_felt_W_m = p_W_m;
  if (!tissue || !(depthInLimb(p_W_m) > 0)) {
    p_proxy_W_m_.reset();
    p_before_W_m_ = p_W_m;
    return stand;
  }
  // in the entry's tick the way in the tissue begins at P0
  if (tissue->entry) p_before_W_m_ = tissue->p_entry_W_m;
  contact(p_W_m);
  if (p_proxy_W_m_) slip(p_W_m);
  if (p_proxy_W_m_) {
    const Vec3 q = *p_proxy_W_m_;
    stand.touching = true;
    stand.p_proxy_W_m = q;
    stand.force_W_N = (q - p_W_m) * stiffness_N_per_m_;          // 3. Force
    if (!tissue->entry && planted_ != BoneDefect::kTipInBone) {  // 4. Tissue
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
