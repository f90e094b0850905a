/// PALPATION: two proxies join springs to the tip. One stays on the skin, as far out as the ball is thick,
/// and sticks to it by friction; its spring is the soft tissue (soft_tissue.h). The other slides on the
/// bones, without friction. Energy: each proxy moves only if its spring then holds less, so neither gives
/// back more than it took.
#include "common/haptics/touch/palpation.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <variant>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/soft_tissue.h"
#include "common/haptics/spec_checker.h"
#include "common/haptics/state_hash.h"
#include "common/haptics/surface.h"
#include "common/haptics/tick.h"
#include "common/haptics/touch/nearby.h"
#include "common/haptics/touch/on_bones.h"

namespace needlelab {
namespace {

using namespace proxy_contact;

constexpr std::size_t kPalpationOwn = stageOf(Effect::kPalpation);
/// Contact may begin so many of Newton's steps from the skin.
constexpr int kMostToSkin = 8;
/// A tick asks mostly so near to a proxy, farther by the tip's way.
constexpr double kNear_m = 5e-4;
/// A shorter slip on the skin, less than a tenth of a millinewton, waits for the next tick.
constexpr double kWaits_m = 1e-7;
/// Among the numbers for the tick, in shells: the depth of the outermost bone, infinite if there is none; and
/// under a plane its unit normal, out of the bone.
constexpr std::size_t kBoneDepth_m = 5, kBoneNormal = 6;
const StageNumbers& numbersOf(const SceneModel& scene) {
  return scene.stage_numbers[kPalpationOwn];
}

template <std::size_t kIndex>
double& palpationNumber(SceneSpec& spec) {
  return spec.stage_numbers[kPalpationOwn][kIndex];
}

constexpr std::array<EffectField, 5> kPalpationFields = {
    {{"skin_stiffness_n_per_m", "Stiffness of skin and soft tissue under the cap", kStiffness, 105,
      palpationNumber<kPalpationSkin_N_per_m>},
     {"bone_stiffness_n_per_m", "Stiffness that bone adds", kStiffness, 600,
      palpationNumber<kPalpationBone_N_per_m>},
     {"friction_coefficient",
      "Friction of the cap on the skin",
      {0, 2},
      0.3,
      palpationNumber<kPalpationFriction>},
     {"radius_m", "Radius of the capped tip", {0, 0.02, true}, 0.003, palpationNumber<kPalpationRadius_m>},
     {"stiffening_share",
      "Share of it that soft tissue adds when pressed flat",
      {0, 1},
      0.5,
      palpationNumber<kPalpationStiffening>}}};

double stiffnessOf(const StageNumbers& numbers) {
  return numbers[kPalpationSkin_N_per_m] + numbers[kPalpationBone_N_per_m];
}

// capped, the needle's other effects do not act: only what exceeds them is added
double addedAcross(const SceneSpec& spec) {
  double others_N_per_m = 0;
  for (const EffectEntry* entry : effectEntries())
    if (entry->effect != Effect::kPalpation && entry->on_device.across_N_per_m != nullptr &&
        (spec.effects & bitOf(entry->effect)) != 0)
      others_N_per_m += entry->on_device.across_N_per_m(spec);
  return std::max(0.0, stiffnessOf(spec.stage_numbers[kPalpationOwn]) - others_N_per_m);
}

void compilePalpation(const SceneSpec& spec, SceneModel& model) {
  StageNumbers& numbers = model.stage_numbers[kPalpationOwn];
  numbers[kBoneDepth_m] = std::numeric_limits<double>::infinity();
  double top_m = 0;
  for (const LayerSpec& layer : spec.layers) {
    if (layer.is_bone) {
      numbers[kBoneDepth_m] = top_m;
      break;
    }
    top_m += layer.thickness_m;
  }
  const Vec3 normal = spec.bone_normal ? normalized(*spec.bone_normal) : model.plane_normal;
  numbers[kBoneNormal] = normal.x;
  numbers[kBoneNormal + 1] = normal.y;
  numbers[kBoneNormal + 2] = normal.z;
}

// shells: what stops the ball's centre
struct PlaneUnderBall {
  Vec3 point_W_m, normal_W;
  static constexpr bool kIsConvex = true;
  [[nodiscard]] double depth(Vec3 p_W_m) const { return -dot(normal_W, p_W_m - point_W_m); }
  [[nodiscard]] Vec3 normal(Vec3 /*p_W_m*/, Vec3 /*motion*/) const { return normal_W; }
};

// shells: the outermost layer of bone at a place; one that slants ends at the skin
std::optional<PlaneUnderBall> boneOfShells(const SceneModel& scene, Vec3 p_W_m, Vec3 motion) {
  const StageNumbers& numbers = numbersOf(scene);
  const double top_m = numbers[kBoneDepth_m], depth_m = signedDepth(scene.limb, p_W_m);
  if (!std::isfinite(top_m)) return std::nullopt;
  PlaneUnderBall found;
  if (!scene.is_plane) {
    const Vec3 normal = surfaceNormal(scene.limb, p_W_m, motion);
    found = {p_W_m - normal * (top_m - depth_m), normal};
  } else {
    found = {scene.plane_point_m - scene.plane_normal * top_m,
             {numbers[kBoneNormal], numbers[kBoneNormal + 1], numbers[kBoneNormal + 2]}};
    if (found.depth(p_W_m) > depth_m) found = {scene.plane_point_m, scene.plane_normal};
  }
  found.point_W_m = found.point_W_m + found.normal_W * numbers[kPalpationRadius_m];
  return found;
}

// releases a surface that the tip has left: the spring shortens to nothing, within `most_m` at once
void release(Vec3 tip_W_m, double most_m, ProxyContact& contact) {
  const Vec3 to_tip = tip_W_m - contact.p_proxy_W_m;
  const double share = shareWithin(-to_tip - contact.stretch_W_m, to_tip, most_m);
  contact.p_proxy_W_m = contact.p_proxy_W_m + to_tip * share;
  if (!(share < 1.0)) contact = {};
}

SoftTissue softTissue(const StageNumbers& numbers) {
  return {numbers[kPalpationSkin_N_per_m], numbers[kPalpationStiffening] * numbers[kPalpationBone_N_per_m]};
}

// What the ball may touch: in a body of the piece, else of the shells.
struct UnderBall {
  const SceneModel& scene;
  const PlacedSurroundings& around;
  double radius_m;

  const Nearby* rest = nullptr;  // about the proxy on the skin

  [[nodiscard]] bool known() const {
    return around.tip != nullptr || !std::holds_alternative<BodyLimb>(scene.limb);
  }
  // of a place, not of a ball
  [[nodiscard]] DistanceAt skinAtTip(Vec3 tip_W_m, Vec3 motion) const {
    return around.tip != nullptr ? around.skinAtTip(tip_W_m) : skin(tip_W_m, motion);
  }
  [[nodiscard]] DistanceAt skin(Vec3 p_W_m, Vec3 motion) const {
    if (rest != nullptr) return rest->skin(p_W_m);
    return {-signedDepth(scene.limb, p_W_m), surfaceNormal(scene.limb, p_W_m, motion)};
  }
  // how far a ball there is from bone
  [[nodiscard]] DistanceAt cover(Vec3 p_W_m, Vec3 motion) const {
    DistanceAt cover{std::numeric_limits<double>::infinity(), {}};
    if (rest != nullptr) {
      cover = rest->bone(p_W_m);
      cover.distance_m -= radius_m;
    } else if (const auto plane = boneOfShells(scene, p_W_m, motion)) {
      cover = {-plane->depth(p_W_m), plane->normal_W};
    }
    cover.distance_m = std::max(0.0, cover.distance_m);
    return cover;
  }
  // the ball on the skin nearest to a place; `slope`: of the skin's distance close to there
  [[nodiscard]] Vec3 onSkin(Vec3 p_W_m, Vec3 motion, int steps, Vec3& slope) const {
    for (int i = 0; i < steps; ++i) {
      const DistanceAt skin = this->skin(p_W_m, motion);
      slope = skin.slope;
      const double size2 = normSquared(slope);
      if (!(size2 > 0.0)) break;
      const double off_m = skin.distance_m - radius_m;
      p_W_m = p_W_m - slope * (off_m / size2);
      if (std::fabs(off_m) <= kWaits_m) break;
    }
    return p_W_m;
  }
};

// The proxy on the skin gives way to the tip's pull and to the bone's push, beyond what friction holds.
// Returns its cover.
DistanceAt slideOnSkin(const UnderBall& under, const SoftTissue& tissue, double friction, Vec3 tip_W_m,
                       Vec3 motion, double most_m, ProxyContact& skin) {
  Vec3& proxy_W_m = skin.p_proxy_W_m;
  DistanceAt cover = under.cover(proxy_W_m, motion);
  Vec3 slope = under.skin(proxy_W_m, motion).slope;
  for (int slip = 0; slip < kMaxSlips; ++slip) {
    const Vec3 stretch = proxy_W_m - tip_W_m;
    const double stretch_m = norm(stretch);
    if (!(stretch_m > 0.0)) return cover;
    if (slope == Vec3{}) return cover;
    const Vec3 normal = normalized(slope);
    const SoftTissue::At now = tissue.at(stretch_m, cover.distance_m);
    const double spring_N_per_m = now.force_N / stretch_m;
    const double holds_N = friction * spring_N_per_m * std::max(0.0, dot(normal, stretch));
    Vec3 along = stretch * -spring_N_per_m - cover.slope * now.per_cover_N;
    along = along - normal * dot(normal, along);
    const double along_N = norm(along), beyond_N = along_N - holds_N;
    if (!(beyond_N > 0.0)) return cover;
    const Vec3 uphill = cover.slope - normal * dot(normal, cover.slope);
    const Vec3 move =
        along * (beyond_N / (along_N * (spring_N_per_m + now.bend_N_per_m * normSquared(uphill))));
    if (!(normSquared(move) > kWaits_m * kWaits_m)) return cover;
    const double most_share = shareWithin(stretch - skin.stretch_W_m, move, most_m);
    bool moved = false;
    for (double share = most_share; !moved && share > 0.05 * most_share; share *= 0.5) {
      const Vec3 to_W_m = under.onSkin(proxy_W_m + move * share, motion, 1, slope);
      const DistanceAt there = under.cover(to_W_m, motion);
      moved = tissue.at(norm(to_W_m - tip_W_m), there.distance_m).energy_J < now.energy_J;
      if (!moved) continue;
      proxy_W_m = to_W_m;
      cover = there;
    }
    if (!moved || most_share < 1.0) return cover;
  }
  return cover;
}

// the force of the skin's spring on the hand. `bone_m`: from the ball at the tip to bone, at least
Vec3 touchSkin(const UnderBall& under, const DistanceAt& at_tip, Vec3 tip_W_m, Vec3 motion,
               Palpation& palpation, double& bone_m) {
  const StageNumbers& numbers = numbersOf(under.scene);
  const double friction = numbers[kPalpationFriction];
  const SoftTissue tissue = softTissue(numbers);
  const double most_m = mostChange(friction, under.scene.period_s, norm(motion));
  ProxyContact& skin = palpation.skin;
  DistanceAt cover;
  if (at_tip.distance_m < under.radius_m) {
    Vec3 slope;
    if (!skin.touching) skin.p_proxy_W_m = under.onSkin(tip_W_m, motion, kMostToSkin, slope);
    skin.touching = true;
    cover = slideOnSkin(under, tissue, friction, tip_W_m, motion, most_m, skin);
  } else if (skin.touching) {
    release(tip_W_m, most_m, skin);
    if (skin.touching) cover = under.cover(skin.p_proxy_W_m, motion);
  }
  if (!skin.touching) return {};
  skin.stretch_W_m = skin.p_proxy_W_m - tip_W_m;
  const double stretch_m = norm(skin.stretch_W_m);
  bone_m = cover.distance_m - kMostSteep * stretch_m;
  const auto now = tissue.at(stretch_m, cover.distance_m);
  palpation.held_J += now.energy_J;
  return stretch_m > 0.0 ? skin.stretch_W_m * (now.force_N / stretch_m) : Vec3{};
}

// one deeper in the bone than it came in this tick began there, and touches nothing
template <class Surface>
void touch(const Surface& surface, double most_m, Vec3 tip_W_m, Vec3 motion, ProxyContact& bone) {
  if (bone.touching) {
    bone.touching = followTip(surface, 0.0, tip_W_m, most_m, bone);
    if (!bone.touching) bone = {};
  } else if (const double depth_m = surface.depth(tip_W_m); depth_m > 0.0 && !(depth_m > most_m)) {
    bone.p_proxy_W_m = onto(surface, tip_W_m, motion);
    bone.touching = true;
  }
}

// the bones of a body's piece, with the last answer
struct BonesAround {
  explicit BonesAround(const Nearby& piece) : near(piece) {}
  const Nearby& near;
  mutable Vec3 last_W_m{std::numeric_limits<double>::infinity(), 0, 0};
  mutable DistanceAt said;
  [[nodiscard]] const DistanceAt& at(Vec3 p_W_m) const {
    if (p_W_m == last_W_m) return said;
    last_W_m = p_W_m;
    return said = near.bone(p_W_m);
  }
  [[nodiscard]] double distance(Vec3 p_W_m) const { return at(p_W_m).distance_m; }
  [[nodiscard]] Vec3 slope(Vec3 p_W_m) const { return at(p_W_m).slope; }
};
struct BallOnBones : OnBones<BonesAround> {
  static constexpr double kStill_m = kWaits_m;
  // in a hollow narrower than the ball no place near is on the surface
  [[nodiscard]] bool reaches(Vec3 from_W_m, Vec3 to_W_m, Vec3 /*tip_W_m*/) const {
    const double away_m = away(to_W_m);
    return !(away_m < -kOn_m) || !(away_m < away(from_W_m));
  }
};

// the force of the bone's spring on the hand
Vec3 touchBones(const UnderBall& under, bool off_skin, Vec3 tip_W_m, Vec3 motion, Palpation& palpation,
                double bone_m) {
  const StageNumbers& numbers = numbersOf(under.scene);
  const double stiffness_N_per_m = (1 - numbers[kPalpationStiffening]) * numbers[kPalpationBone_N_per_m];
  const double most_m = mostChange(0.0, under.scene.period_s, norm(motion));
  ProxyContact& bone = palpation.bone;
  if (off_skin && bone.touching) {
    release(tip_W_m, most_m, bone);  // also a proxy that is behind a bone
  } else if (under.around.tip != nullptr) {
    if (!bone.touching && bone_m > 0.0) return {};
    const Nearby near(under.around, *under.around.tip, bone.touching ? bone.p_proxy_W_m : tip_W_m,
                      kNear_m + norm(motion));
    touch(BallOnBones{{BonesAround(near), under.radius_m}}, most_m, tip_W_m, motion, bone);
  } else if (const auto plane =
                 boneOfShells(under.scene, bone.touching ? bone.p_proxy_W_m : tip_W_m, motion)) {
    touch(*plane, most_m, tip_W_m, motion, bone);
  }
  if (!bone.touching) return {};
  bone.stretch_W_m = bone.p_proxy_W_m - tip_W_m;
  palpation.held_J += 0.5 * stiffness_N_per_m * normSquared(bone.stretch_W_m);
  return bone.stretch_W_m * stiffness_N_per_m;
}

void hashPalpation(const SimState& state, StateHash& hash) {
  const Palpation& now = state.palpation;
  if (!now.capped) return;
  hash.add(std::uint64_t{now.clear} << 1 | std::uint64_t{now.skin.touching} << 2 |
           std::uint64_t{now.bone.touching} << 3);
  for (const Vec3 v :
       {now.skin.p_proxy_W_m, now.skin.stretch_W_m, now.bone.p_proxy_W_m, now.bone.stretch_W_m})
    hash.add(v);
}

}  // namespace

double capRadius_m(const SceneModel& scene) noexcept {
  assert(scene.isLive(Effect::kPalpation));
  return numbersOf(scene)[kPalpationRadius_m];
}

bool changeCap(const SceneModel& scene, const PlacedSurroundings& around, bool on, const TipSample& sample,
               SimState& state) noexcept {
  const Palpation& now = state.palpation;
  if (now.capped == on || state.inside || !isFinite(sample)) return now.capped;
  const UnderBall under{scene, around, capRadius_m(scene)};
  const bool clear = under.known() && !(under.skinAtTip(sample.p_WT_m, {}).distance_m < under.radius_m);
  // a lesson may begin with the tip anywhere
  if (state.has_prev && (!clear || now.skin.touching || now.bone.touching)) return now.capped;
  setCap(on, clear, state);
  return on;
}

void setCap(bool on, bool clear, SimState& state) noexcept {
  state.palpation = {.capped = on, .clear = on && clear, .skin = {}, .bone = {}};
  state.bone = {};
  // a path of a body may be of another place: no entry before one puts the tip outside
  state.inside = state.in_limb = state.outside_once = false;
}

void palpate(const SceneModel& scene, const PlacedSurroundings& around, const TipSample& sample,
             SimState& state, StepReport& report) noexcept {
  assert(state.palpation.capped && !state.inside);
  report.stage_N.fill(0.0);
  if (!isFinite(sample)) return clearReport(report, 0.0, kFlagNotStepped | kFlagCapped);
  Palpation& now = state.palpation;
  UnderBall under{scene, around, capRadius_m(scene)};
  const Vec3 motion = state.has_prev ? sample.p_WT_m - state.p_prev_W_m : Vec3{0, 0, -1} * kOnSurface_m;
  const DistanceAt skin = under.known() ? under.skinAtTip(sample.p_WT_m, motion) : DistanceAt{};
  clearReport(report, -skin.distance_m, kFlagCapped);
  if (!(skin.distance_m < under.radius_m)) now.clear = true;
  now.held_J = 0;
  if (now.clear && under.known()) {
    // outside of the skin there is no bone; a ball off it is not on bone
    double bone_m = skin.distance_m - under.radius_m;
    std::optional<Nearby> rest;
    if (around.rest != nullptr && (now.skin.touching || !(bone_m > 0.0)))
      rest.emplace(around, *around.rest, now.skin.touching ? now.skin.p_proxy_W_m : sample.p_WT_m,
                   kNear_m + norm(motion));
    under.rest = rest ? &*rest : nullptr;
    Vec3 force_W_N = touchSkin(under, skin, sample.p_WT_m, motion, now, bone_m);
    force_W_N = force_W_N +
                touchBones(under, !(skin.distance_m < under.radius_m), sample.p_WT_m, motion, now, bone_m);
    report.stage_N[kPalpationOwn] = norm(force_W_N);
    capForce(scene, force_W_N, report);
    report.wrench_W.force_N = force_W_N;
  } else if (under.known()) {
    report.flags |= kFlagStartedInside;
  }
  state.p_prev_W_m = sample.p_WT_m;
  state.depth_prev_m = -skin.distance_m;
  state.has_prev = true;
}

extern const EffectEntry kPalpationEntry;
constinit const EffectEntry kPalpationEntry = {
    .effect = Effect::kPalpation,
    .name = "PALPATION",
    .label = "Palpation: the capped needle feels skin and bone",
    .short_name = "palp",
    .term = "palpation",
    .along_u = false,
    .colour = 0xE7B98A,
    .place = 9,
    .value =
        [](const StepReport& report) {
          return (report.flags & kFlagCapped) != 0 ? report.stage_N[kPalpationOwn] : 0.0;
        },
    .section = "palpation",
    .fields = kPalpationFields,
    .hasNumbers =
        [](const SceneSpec& spec) { return spec.stage_numbers[kPalpationOwn][kPalpationSkin_N_per_m] > 0; },
    .stiffness_N_per_m = [](const SceneModel& model) { return stiffnessOf(numbersOf(model)); },
    .acts_with = ActsWith::kNothing,
    .on_device = {.words = "palpation",
                  .across_N_per_m = addedAcross,
                  .without = "the needle has no cap",
                  .was_without = "the needle had no cap"},
    .lower =
        [](SceneSpec& spec, double share) {
          spec.stage_numbers[kPalpationOwn][kPalpationSkin_N_per_m] *= share;
          spec.stage_numbers[kPalpationOwn][kPalpationBone_N_per_m] *= share;
        },
    .compile = compilePalpation,
    .hashLasting = hashPalpation};

}  // namespace needlelab
