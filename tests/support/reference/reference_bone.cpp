#include "tests/support/reference/reference_bone.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

namespace needlelab::test {
namespace {

constexpr int kMaxSlips = 8, kMostHalvings = 4, kWaySteps = 64;
constexpr double kOnSurface_m = 1e-9, kFallSpeed_mps = 0.02;

Vec3 nearestOnAxis(const CapsuleLimb& limb, Vec3 p_W_m) {
  const Vec3 along = limb.b_m - limb.a_m;
  const double t = std::clamp(dot(p_W_m - limb.a_m, along) / dot(along, along), 0.0, 1.0);
  return limb.a_m + along * t;
}

}  // namespace

ReferenceBone::ReferenceBone(SceneSpec scene, double rate_hz, BoneDefect planted)
    : scene_(std::move(scene)),
      period_s_(1 / rate_hz),
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

// 1. Under a plane "at the share g/(g + b) with g = max(0, −b')". Under a round skin "at the first place with
// δ_b > 0. It is looked for at 64 places at most and at the end of the way: first as far from p' as the bone
// is …, then on by the distance to the bone, at least 1/64 of the way."
std::optional<Vec3> ReferenceBone::meeting(Vec3 from_W_m, Vec3 to_W_m) const {
  const Vec3 way = to_W_m - from_W_m;
  if (std::holds_alternative<PlaneLimb>(scene_.limb)) {
    const double g = std::max(0.0, -belowPlane(from_W_m)), b = belowPlane(to_W_m);
    if (!(b > 0)) return std::nullopt;
    return from_W_m + way * (g / (g + b));
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

// 1. Contact begins: at that place, onto the surface, or at p' "if that was more than 1 nm in the bone"
bool ReferenceBone::contactBegins(Vec3 p_W_m) {
  if (p_proxy_W_m_ || !p_before_W_m_) return false;
  const std::optional<Vec3> met = meeting(*p_before_W_m_, p_W_m);
  if (!met) return false;
  if (planted_ == BoneDefect::kBeginsAtTip)  // planted
    p_proxy_W_m_ = ontoBone(p_W_m);
  else if (depthInBone(*p_before_W_m_) > kOnSurface_m)
    p_proxy_W_m_ = p_before_W_m_;
  else
    p_proxy_W_m_ = ontoBone(*met);
  stretch_before_W_m_ = Vec3{};
  return true;
}

// 2. Room: "the greatest share ≤ 1 with |s − s'| ≤ M, or ≤ what it was before the move where that is more"
double ReferenceBone::shareInRoom(Vec3 move_W_m, Vec3 p_W_m) const {
  if (planted_ == BoneDefect::kNoRoom) return 1;                       // planted
  const Vec3 changed = (*p_proxy_W_m_ - p_W_m) - stretch_before_W_m_;  // s − s' before the move
  const double most = std::max(room_m_, norm(changed));
  if (norm(changed + move_W_m) <= most) return 1;
  // the greater root of |changed + share·move|² = most²
  const double a = dot(move_W_m, move_W_m), b = dot(changed, move_W_m);
  const double c = dot(changed, changed) - most * most;
  return std::clamp((-b + std::sqrt(std::max(0.0, b * b - a * c))) / a, 0.0, 1.0);
}

// … and the move. Returns whether it was complete
bool ReferenceBone::moveBy(Vec3 move_W_m, Vec3 p_W_m) {
  const double share = shareInRoom(move_W_m, p_W_m);
  p_proxy_W_m_ = *p_proxy_W_m_ + move_W_m * share;
  if (share < 1) stand_.cut = true;
  return share == 1;
}

double ReferenceBone::stretchAtSkin(Vec3 p_W_m) const {
  return std::sqrt(1 + friction_ * friction_) * depthInLimb(p_W_m);
}

// 2. Skin: "For |s| > √(1 + μ²)·δ, q moves straight toward p until it is equal"
void ReferenceBone::skin(Vec3 p_W_m) {
  const Vec3 s = *p_proxy_W_m_ - p_W_m;
  const double most = stretchAtSkin(p_W_m);
  if (!(norm(s) > most)) return;
  stand_.skin = true;
  moveBy(s * (most / norm(s) - 1), p_W_m);
}

// 2. Back: "If q is more than 1 nm outside the bone it moves onto the surface, if that shortens |s|"
void ReferenceBone::back(Vec3 p_W_m) {
  const Vec3 q = *p_proxy_W_m_;
  if (!(depthInBone(q) < -kOnSurface_m)) return;
  if (!(norm(ontoBone(q) - p_W_m) < norm(q - p_W_m))) return;
  stand_.back = true;
  moveBy(ontoBone(q) - q, p_W_m);
}

// 2. Slip: one step. Returns whether another one follows
bool ReferenceBone::slipOnce(Vec3 p_W_m, bool last_look) {
  const Vec3 q = *p_proxy_W_m_, n = normalAt(q);
  const double g = -dot(n, p_W_m - q);
  if (!(g > 0)) {
    // "q moves to p: the contact ends if it gets there"
    if (moveBy(p_W_m - q, p_W_m) || planted_ == BoneDefect::kEndsAtOnce)  // planted: the second
      p_proxy_W_m_.reset();
    else
      stand_.stayed = true;
    return false;
  }
  const Vec3 aside = (p_W_m - q) + n * g;
  const double t = norm(aside);
  if (t <= friction_ * g || last_look || planted_ == BoneDefect::kSticks) return false;  // planted: the last
  const double way = planted_ == BoneDefect::kSlipsToFoot ? t : t - friction_ * g;       // planted: the first
  const double room = shareInRoom(aside * (way / t), p_W_m);
  if (room < 1) stand_.cut = true;
  // "Where both do not shorten |s| the cut move is halved, up to four times, then left out."
  const bool outside = depthInBone(q) < -kOnSurface_m;
  double share = room;
  for (int i = 0; i <= kMostHalvings; ++i, share /= 2) {
    Vec3 to = q + aside * (share * way / t);
    if (!(depthInBone(to) > kOnSurface_m)) to = ontoBone(to);
    // "where q was more than 1 nm outside, the whole slip is cut"
    const double whole = outside ? shareInRoom(to - q, p_W_m) : 1;
    to = q + (to - q) * whole;
    if (!(norm(to - p_W_m) < norm(q - p_W_m))) continue;
    p_proxy_W_m_ = to;
    return room == 1 && whole == 1;
  }
  return false;
}

void ReferenceBone::slip(Vec3 p_W_m) {
  const int most = planted_ == BoneDefect::kOneSlip ? 1 : kMaxSlips;  // planted: the first
  for (int i = 0; i <= most; ++i)
    if (!slipOnce(p_W_m, i == most)) return;
}

// 4. "h = max(0, u·(p − P0) − max(u·(q − P0), w, w_f)), at most 0.9·δ"
double ReferenceBone::heldBack(Vec3 p_W_m, const BoneTissue& tissue) const {
  const double x = dot(tissue.u_W, p_W_m - tissue.p_entry_W_m);
  const double of_proxy = dot(tissue.u_W, *p_proxy_W_m_ - tissue.p_entry_W_m);
  const double held = std::max(0.0, x - std::max({of_proxy, tissue.wall, tissue.friction_wall}));
  if (planted_ == BoneDefect::kNotHeldToSkin) return held;  // planted
  return std::min(held, 0.9 * depthInLimb(p_W_m));
}

// 5. "what the tissue pushes out with only falls"; "the first tick with h > 0 … has no bound"
BonePushes ReferenceBone::onlyFall(BonePushes now) {
  const auto live = [&](Effect effect) { return (scene_.effects & bitOf(effect)) != 0; };
  const std::optional<BonePushes> last = pushes_before_;
  const auto feltByWalls = [&] {
    double x_c = now.x_m;
    for (const BonePushes::Membrane& one : now.membranes) x_c = std::min(x_c, one.place_m);
    return x_c;
  };
  // Pulls: where a membrane gave way in this tick, a wall ahead of x_c comes back to it
  if (now.ruptured) {
    now.wall_m = std::min(now.wall_m, feltByWalls());
    if (live(Effect::kShaftFriction)) now.friction_wall_m = std::min(now.friction_wall_m, feltByWalls());
  }
  // Membranes: "each intact membrane that was met moves by max(0, min(z, Δ)), z its stretch; w and w_f by
  // what x_c changes"
  const double grown = last ? now.x_m - (last->x_m + now.turned_m) : 0;
  if (live(Effect::kPuncture) && grown > 0 && planted_ != BoneDefect::kMembranesGrow) {  // planted: the last
    const double x_c_before = feltByWalls();
    for (BonePushes::Membrane& one : now.membranes)
      one.place_m += std::max(0.0, std::min(now.x_m - one.place_m, grown));
    now.wall_m += feltByWalls() - x_c_before;
    now.friction_wall_m += feltByWalls() - x_c_before;
  }
  for (const BonePushes::Membrane& one : now.membranes) {
    const double z = std::max(0.0, now.x_m - one.place_m);
    now.puncture_N += one.k1_N_per_m * z + one.k2_N_per_m2 * z * z;
  }
  // Cutting, then friction: "A force above that of the last such tick is lowered to it, and its wall moved to
  // fit"
  const double x_c = feltByWalls();
  if (live(Effect::kCutting)) {
    now.cutting_N = std::max(0.0, now.wall_N_per_m * (x_c - now.wall_m));
    if (last && now.cutting_N > last->cutting_N &&
        planted_ != BoneDefect::kCuttingGrows) {  // planted: the last
      now.cutting_N = last->cutting_N;
      now.wall_m = x_c - now.cutting_N / now.wall_N_per_m;
    }
  }
  if (live(Effect::kShaftFriction)) {
    now.friction_N = std::max(0.0, now.friction_N_per_m * (x_c - now.friction_wall_m));
    if (last && now.friction_N > last->friction_N && planted_ != BoneDefect::kFrictionGrows) {  // … the last
      now.friction_N = last->friction_N;
      now.friction_wall_m = x_c - now.friction_N / now.friction_N_per_m;
    }
  }
  pushes_before_ = now;
  return now;
}

ReferenceBone::Stand ReferenceBone::step(Vec3 p_W_m, const std::optional<BoneTissue>& tissue) {
  // "A sample that is not finite changes nothing"
  if (!std::isfinite(p_W_m.x) || !std::isfinite(p_W_m.y) || !std::isfinite(p_W_m.z)) return stand_;
  stand_ = Stand{};
  stand_.felt_depth_m = depthInLimb(p_W_m);
  // "A tick with δ ≤ 0 forgets the contact: so does every tick without an insertion before it"
  if (!tissue || tissue->entry || !(depthInLimb(p_W_m) > 0)) p_proxy_W_m_.reset();
  if (!tissue || !(depthInLimb(p_W_m) > 0)) {
    p_before_W_m_ = p_W_m;
    pushes_before_.reset();
    return stand_;
  }
  // in the entry tick the way begins at P0
  if (tissue->entry) p_before_W_m_ = tissue->p_entry_W_m;

  const bool begins = contactBegins(p_W_m);
  const double friction = planted_ == BoneDefect::kNarrowRoom ? 0.0 : friction_;  // planted: the first
  room_m_ = std::sqrt(2 + friction * friction) * norm(p_W_m - *p_before_W_m_) + kFallSpeed_mps * period_s_;
  const bool with_skin = (!begins || planted_ == BoneDefect::kSkinAtBegin) &&
                         planted_ != BoneDefect::kSkinForgotten;  // planted: the second and third
  if (p_proxy_W_m_ && with_skin) skin(p_W_m);
  if (p_proxy_W_m_ && planted_ != BoneDefect::kStaysOut) back(p_W_m);  // planted: the second
  if (p_proxy_W_m_) slip(p_W_m);
  if (p_proxy_W_m_) {
    stretch_before_W_m_ = *p_proxy_W_m_ - p_W_m;  // 3. Stretch
    if (!tissue->entry && planted_ != BoneDefect::kTipInBone) stand_.held_m = heldBack(p_W_m, *tissue);
    stand_.touching = true;
    stand_.p_proxy_W_m = *p_proxy_W_m_;
    stand_.force_W_N = stretch_before_W_m_ * stiffness_N_per_m_;  // 5. Force
    stand_.p_felt_W_m = p_W_m - tissue->u_W * stand_.held_m;
    stand_.felt_depth_m = depthInLimb(stand_.p_felt_W_m);
  }
  if (!(stand_.held_m > 0)) pushes_before_.reset();
  p_before_W_m_ = p_W_m;
  return stand_;
}

}  // namespace needlelab::test
