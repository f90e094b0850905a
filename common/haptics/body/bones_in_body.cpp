/// BONE in a body: its bones themselves (bone_contact.h has the contact).
#include "common/haptics/body/bones_in_body.h"

#include <algorithm>
#include <cassert>

#include "common/haptics/touch/bone_contact.h"
#include "common/haptics/touch/on_bones.h"

namespace needlelab {
namespace {

using namespace bone_contact;

/// A needle's shaft bends by no more than this: farther aside of it no tip slides along a bone.
constexpr double kBends_m = 1.5e-3;
/// More than rounding adds to a distance.
constexpr double kSurely_m = 1e-9;

// the bones, which a body's skin ends
struct BonesInBody : OnBones<const PlacedBones&> {
  const SceneModel& model;
  Vec3 u_W;

  BonesInBody(const SceneModel& of, Vec3 u) : OnBones<const PlacedBones&>{of.bones}, model(of), u_W(u) {}

  [[nodiscard]] double depth(Vec3 p_W_m) const { return std::min(-away(p_W_m), depthIn(model, p_W_m)); }
  [[nodiscard]] Vec3 normal(Vec3 p_W_m, Vec3 motion) const {
    return -away(p_W_m) > depthIn(model, p_W_m) ? model.plane_normal : OnBones::normal(p_W_m, motion);
  }
  [[nodiscard]] bool meets(Vec3 from_W_m, Vec3 to_W_m, Vec3& at_W_m) const {
    return OnBones::meets(from_W_m, to_W_m, false, at_W_m);
  }
  using OnBones::meets;

  [[nodiscard]] bool reaches(Vec3 from_W_m, Vec3 to_W_m, Vec3 tip_W_m) const {
    const auto aside2 = [&](Vec3 p_W_m) {
      const Vec3 arm = p_W_m - tip_W_m;
      return normSquared(arm - u_W * dot(u_W, arm));
    };
    const double to_m2 = aside2(to_W_m);
    return to_m2 <= kBends_m * kBends_m || to_m2 <= aside2(from_W_m);
  }

  // no bone is in this ball
  [[nodiscard]] bool isClear(const BoneContact& bone, Vec3 from_W_m, Vec3 to_W_m) const {
    return normSquared(to_W_m - bone.p_clear_W_m) < bone.clear_m2 &&
           normSquared(from_W_m - bone.p_clear_W_m) < bone.clear_m2;
  }
  void findClear(Vec3 tip_W_m, BoneContact& bone) const {
    const double clear_m = away(tip_W_m) / kMostSteep - kSurely_m;
    bone.p_clear_W_m = tip_W_m;
    bone.clear_m2 = clear_m > 0.0 ? clear_m * clear_m : 0.0;
  }
};

}  // namespace

void useBones(SceneModel& model) {
  assert(model.isLive(Effect::kBone) && model.is_plane);
  const bool has_bones = model.bones.bones != nullptr;
  model.hold = has_bones ? holdTip<BonesInBody> : nullptr;
  std::uint32_t others = 0;
  for (std::uint32_t i = 0; i < model.stage_count; ++i)
    if (model.stages[i] != effectEntry(Effect::kBone).stage) model.stages[others++] = model.stages[i];
  model.stage_count = others;
  if (has_bones) model.stages[model.stage_count++] = pressBone<BonesInBody>;
  if (model.hold != nullptr)
    model.step_function = stepHeld;
  else if (model.stage_count > 0)
    model.step_function = stepWithStages;
  else
    model.step_function = model.placed_step;
}

StructureIndex touchedBone(const SceneModel& model, const SimState& state) noexcept {
  assert(state.bone.touching && model.bones.bones != nullptr);
  return model.bones.structureAt(state.bone.p_proxy_W_m);
}

}  // namespace needlelab
