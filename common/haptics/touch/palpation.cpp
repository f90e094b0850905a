/// PALPATION: two proxies join springs to the tip. One stays on the skin, as far out as the ball is thick,
/// and sticks to it by friction; the other slides on the bones, without friction. Energy: each proxy moves
/// only if that shortens its spring, so neither gives back more than it took.
#include "common/haptics/touch/palpation.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <variant>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"
#include "common/haptics/state_hash.h"
#include "common/haptics/surface.h"
#include "common/haptics/tick.h"
#include "common/haptics/touch/on_bones.h"

namespace needlelab {
namespace {

using namespace proxy_contact;

constexpr std::size_t kPalpationOwn = stageOf(Effect::kPalpation);
/// Among the numbers for the tick, in shells: the depth of the outermost bone, infinite if there is none; and
/// under a plane its unit normal, out of the bone.
constexpr std::size_t kBoneDepth_m = 4, kBoneNormal = 5;
/// A body's depth is not exact where parts of the skin blend, but less wrong than this: nearer than that, the
/// skin is looked for.
constexpr double kInexact_m = 0.001;

const StageNumbers& numbersOf(const SceneModel& scene) {
  return scene.stage_numbers[kPalpationOwn];
}

template <std::size_t kIndex>
double& palpationNumber(SceneSpec& spec) {
  return spec.stage_numbers[kPalpationOwn][kIndex];
}

constexpr std::array<EffectField, 4> kPalpationFields = {
    {{"skin_stiffness_n_per_m", "Stiffness of skin and soft tissue under the cap", kStiffness, 300,
      palpationNumber<kPalpationSkin_N_per_m>},
     {"bone_stiffness_n_per_m", "Stiffness that bone adds", kStiffness, 600,
      palpationNumber<kPalpationBone_N_per_m>},
     {"friction_coefficient",
      "Friction of the cap on the skin",
      {0, 2},
      0.3,
      palpationNumber<kPalpationFriction>},
     {"radius_m", "Radius of the capped tip", {0, 0.02, true}, 0.003, palpationNumber<kPalpationRadius_m>}}};

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

// How far the ball is in the skin, along the normal of the nearest place.
struct Pressed {
  double depth_m = 0;
  Vec3 normal_W;
};
Pressed pressedBy(const SceneModel& scene, Vec3 tip_W_m, double depth_m, Vec3 motion) {
  const double radius_m = numbersOf(scene)[kPalpationRadius_m];
  if (!(depth_m + radius_m > -kInexact_m)) return {depth_m + radius_m, {}};
  const Vec3 at_W_m = nearestSkin(scene.limb, tip_W_m, motion);
  const Vec3 normal_W = surfaceNormal(scene.limb, at_W_m, motion);
  return {dot(normal_W, at_W_m - tip_W_m) + radius_m, normal_W};
}

void touchSkin(const SceneModel& scene, Vec3 tip_W_m, Vec3 motion, const Pressed& pressed,
               ProxyContact& skin) {
  const double friction = numbersOf(scene)[kPalpationFriction];
  const double most_m = mostChange(friction, scene.period_s, norm(motion));
  if (!(pressed.depth_m > 0.0)) {
    if (skin.touching) release(tip_W_m, most_m, skin);
  } else {
    // straight out of the skin; a proxy that sticks is at most the cone's radius from there
    const Vec3 out_W_m = tip_W_m + pressed.normal_W * pressed.depth_m;
    if (!skin.touching) skin.p_proxy_W_m = out_W_m;
    const Vec3 stretch = skin.p_proxy_W_m - tip_W_m, slide = out_W_m - skin.p_proxy_W_m;
    const double slide_m = norm(slide), sticks_m = friction * pressed.depth_m;
    if (slide_m > sticks_m) {
      Vec3 move = slide * (1.0 - sticks_m / slide_m);
      move = move * shareWithin(stretch - skin.stretch_W_m, move, most_m);
      if (normSquared(stretch + move) < normSquared(stretch)) skin.p_proxy_W_m = skin.p_proxy_W_m + move;
    }
    skin.touching = true;
  }
  if (skin.touching) skin.stretch_W_m = skin.p_proxy_W_m - tip_W_m;
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

void touchBones(const SceneModel& scene, const PlacedBones& bones, Vec3 tip_W_m, Vec3 motion,
                ProxyContact& bone) {
  const double most_m = mostChange(0.0, scene.period_s, norm(motion));
  if (bones.bones != nullptr) {
    touch(OnBones{bones, numbersOf(scene)[kPalpationRadius_m]}, most_m, tip_W_m, motion, bone);
  } else if (std::holds_alternative<BodyLimb>(scene.limb)) {
    if (bone.touching) release(tip_W_m, most_m, bone);
  } else if (const auto plane = boneOfShells(scene, bone.touching ? bone.p_proxy_W_m : tip_W_m, motion)) {
    touch(*plane, most_m, tip_W_m, motion, bone);
  }
  if (bone.touching) bone.stretch_W_m = bone.p_proxy_W_m - tip_W_m;
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

bool changeCap(const SceneModel& scene, bool on, const TipSample& sample, SimState& state) noexcept {
  const Palpation& now = state.palpation;
  if (now.capped == on || state.inside || !isFinite(sample)) return now.capped;
  const bool clear = !(signedDepth(scene.limb, sample.p_WT_m) > -capRadius_m(scene));
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

void palpate(const SceneModel& scene, const PlacedBones& bones, const TipSample& sample, SimState& state,
             StepReport& report) noexcept {
  assert(state.palpation.capped && !state.inside);
  report.stage_N.fill(0.0);
  if (!isFinite(sample)) return clearReport(report, 0.0, kFlagNotStepped | kFlagCapped);
  Palpation& now = state.palpation;
  const double depth_m = signedDepth(scene.limb, sample.p_WT_m);
  const Vec3 motion = state.has_prev ? sample.p_WT_m - state.p_prev_W_m : Vec3{0, 0, -1} * kOnSurface_m;
  const Pressed pressed = pressedBy(scene, sample.p_WT_m, depth_m, motion);
  clearReport(report, depth_m, kFlagCapped);
  if (!(pressed.depth_m > 0.0)) now.clear = true;
  if (now.clear) {
    touchSkin(scene, sample.p_WT_m, motion, pressed, now.skin);
    touchBones(scene, bones, sample.p_WT_m, motion, now.bone);
    Vec3 force_W_N = now.skin.stretch_W_m * numbersOf(scene)[kPalpationSkin_N_per_m] +
                     now.bone.stretch_W_m * numbersOf(scene)[kPalpationBone_N_per_m];
    report.stage_N[kPalpationOwn] = norm(force_W_N);
    capForce(scene, force_W_N, report);
    report.wrench_W.force_N = force_W_N;
  } else {
    report.flags |= kFlagStartedInside;
  }
  state.p_prev_W_m = sample.p_WT_m;
  state.depth_prev_m = depth_m;
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
