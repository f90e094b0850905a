/// BONE in a scene of shells: the outermost layer of bone (bone_contact.h has the contact).
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <string>

#include "common/haptics/spec_checker.h"
#include "common/haptics/state_hash.h"
#include "common/haptics/surface.h"
#include "common/haptics/touch/bone_contact.h"

namespace needlelab {
namespace {

using namespace bone_contact;

template <std::size_t kIndex>
double& boneNumber(SceneSpec& spec) {
  return spec.stage_numbers[kBoneOwn][kIndex];
}

constexpr std::array<EffectField, 2> kBoneFields = {
    {{"stiffness_n_per_m", "Stiffness of the bone", kStiffness, 600, boneNumber<kBoneStiffness_N_per_m>},
     {"friction_coefficient", "Friction along the bone", {0, 2}, 0.3, boneNumber<kBoneFriction>}}};

constexpr double kShortestNormal = 1e-6;  // a direction shorter than this has no meaning after rounding

double belowBonePlane(const SceneModel& model, Vec3 p_W_m) {
  return -dot(model.bone_normal, p_W_m - model.bone_point_m);
}

// the outermost layer of bone
struct BoneLayer {
  const SceneModel& model;
  Vec3 u_W;  // a convex bone needs none
  static constexpr bool kIsConvex = true;

  // a slanting bone ends at the skin
  [[nodiscard]] double depth(Vec3 p_W_m) const {
    if (model.bone_is_plane) return std::min(belowBonePlane(model, p_W_m), depthIn(model, p_W_m));
    return depthIn(model, p_W_m) - model.bone_top_m;
  }

  // at a centre, against `motion`
  [[nodiscard]] Vec3 normal(Vec3 p_W_m, Vec3 motion) const {
    if (!model.bone_is_plane) return surfaceNormal(model.limb, p_W_m, motion);
    return belowBonePlane(model, p_W_m) <= depthIn(model, p_W_m) ? model.bone_normal : model.plane_normal;
  }

  bool meets(Vec3 from_W_m, Vec3 to_W_m, Vec3& at_W_m) const {
    const Vec3 way = to_W_m - from_W_m;
    if (model.bone_is_plane) {
      const double gap_m = std::max(0.0, -belowBonePlane(model, from_W_m));
      const double end_gap_m = -belowBonePlane(model, to_W_m);
      if (end_gap_m < 0.0) at_W_m = from_W_m + way * (gap_m / (gap_m - end_gap_m));
      return end_gap_m < 0.0;
    }
    const double gap_m = std::max(0.0, -depth(from_W_m)), end_gap_m = -depth(to_W_m);
    const double length_m = norm(way);
    if (gap_m + end_gap_m > length_m) return false;  // no point in between reaches the bone
    // a round bone may be left again within the path: advance each time by a distance that cannot contain
    // bone
    double gone_m = gap_m;
    for (int i = 0; i < kMaxSteps && gone_m < length_m; ++i) {
      at_W_m = from_W_m + way * (gone_m / length_m);
      const double left_m = -depth(at_W_m);
      if (left_m < 0.0) return true;
      gone_m += std::max(left_m, length_m / kMaxSteps);
    }
    at_W_m = to_W_m;
    return end_gap_m < 0.0;
  }
};

void checkNormal(const SceneSpec& spec, SpecChecker& check) {
  const Vec3 normal = *spec.bone_normal;
  const auto* plane = std::get_if<PlaneLimb>(&spec.limb);
  check.require(plane != nullptr, "normal",
                "is given, but limb is not a plane: its bone is as round as its skin");
  check.point("normal", normal);
  check.require(norm(normal) >= kShortestNormal, "normal",
                "is not a direction: give a vector that is not zero, pointing out of the bone");
  check.require(plane == nullptr || dot(normal, plane->normal) >= 0.5 * norm(normal) * norm(plane->normal),
                "normal", "is more than 60 degrees from the skin's normal");
}

bool isBone(const LayerSpec& layer) {
  return layer.is_bone;
}

bool hasBone(const SceneSpec& spec) {
  return std::any_of(spec.layers.begin(), spec.layers.end(), isBone);
}

// finds the outermost bone; on a plane limb it is the plane through the bone's top below the limb's point
void compileBone(const SceneSpec& spec, SceneModel& model) {
  model.hold = holdTip<BoneLayer>;
  const auto bone = std::find_if(spec.layers.begin(), spec.layers.end(), isBone);
  model.bone_layer = static_cast<std::uint32_t>(bone - spec.layers.begin());
  model.bone_top_m = model.layers[model.bone_layer].top_m;
  if (!model.is_plane) return;
  model.bone_is_plane = true;
  model.bone_point_m = model.plane_point_m - model.plane_normal * model.bone_top_m;
  model.bone_normal = spec.bone_normal ? normalized(*spec.bone_normal) : model.plane_normal;
}

void hashBone(const SimState& state, StateHash& hash) {
  const BoneContact& bone = state.bone;
  if (!bone.touching) return;  // scenes without BONE keep their hash from before it existed
  hash.add(bone.p_proxy_W_m);
  hash.add(bone.stretch_W_m);
  for (const double d : {bone.held_m, bone.cutting_N, bone.friction_N, bone.place_m}) hash.add(d);
}

}  // namespace

extern const EffectEntry kBoneEntry;
constinit const EffectEntry kBoneEntry = {
    .effect = Effect::kBone,
    .name = "BONE",
    .label = "Bone: a stiff surface that no needle enters",
    .short_name = "bone",
    .term = "bone",
    .along_u = false,
    .colour = 0xD8CFC0,
    .place = 7,
    .value = [](const StepReport& report) { return report.stage_N[kBoneOwn]; },
    .section = "bone",
    .fields = kBoneFields,
    .check =
        [](const SceneSpec& spec, SpecChecker& check) {
          if (spec.bone_normal) checkNormal(spec, check);
          check.enter("layers[0].");
          check.require((spec.effects & bitOf(Effect::kBone)) == 0 || spec.layers.empty() ||
                            std::holds_alternative<BodyLimb>(spec.limb) || !spec.layers.front().is_bone,
                        "tissue", "is BONE, and effects lists BONE: bone needs another layer above it");
        },
    .hasNumbers =
        [](const SceneSpec& spec) {
          return spec.stage_numbers[kBoneOwn][kBoneStiffness_N_per_m] > 0 && hasBone(spec);
        },
    .stiffness_N_per_m =
        [](const SceneModel& model) { return model.stage_numbers[kBoneOwn][kBoneStiffness_N_per_m]; },
    .acts_with = ActsWith::kNothing,
    // a proxy that slips along the bone also moves the tissue's springs, which act beside the bone's
    .slope_N_per_m =
        [](const SceneSpec& spec) {
          const StageNumbers& bone = spec.stage_numbers[kBoneOwn];
          return bone[kBoneStiffness_N_per_m] * steepestStretch(bone[kBoneFriction]);
        },
    .remark = [](const SceneSpec& spec) -> std::string {
      return hasBone(spec) ? "" : "and no layer's tissue is BONE";
    },
    .on_device = {.words = "bone",
                  .across_N_per_m =
                      [](const SceneSpec& spec) {
                        return hasBone(spec) ? spec.stage_numbers[kBoneOwn][kBoneStiffness_N_per_m] : 0.0;
                      },
                  .without = "the needle cuts bone as it cuts a layer of tissue",
                  .was_without = "the needle cut it as it cuts a layer of tissue"},
    .lower = [](SceneSpec& spec,
                double share) { spec.stage_numbers[kBoneOwn][kBoneStiffness_N_per_m] *= share; },
    .stage = pressBone<BoneLayer>,
    .closes = isBone,
    .compile = compileBone,
    .hash = hashBone};

}  // namespace needlelab
