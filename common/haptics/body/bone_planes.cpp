/// BONE in a body: a few bones near the tip, each as the plane that touches it (bone_contact.h has the
/// contact).
#include "common/haptics/body/bone_planes.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "common/haptics/touch/bone_contact.h"
#include "common/haptics/touch/touching_planes.h"

namespace needlelab {
namespace {

using namespace bone_contact;

// the bones near the tip, which a body's skin ends
struct BonePlanes : TouchingPlanes {
  const SceneModel& model;

  explicit BonePlanes(const SceneModel& of)
      : TouchingPlanes{{of.bone_planes.data(), of.bone_plane_count}}, model(of) {}

  [[nodiscard]] double depth(Vec3 p_W_m) const {
    return std::min(TouchingPlanes::depth(p_W_m), depthIn(model, p_W_m));
  }

  [[nodiscard]] Vec3 normal(Vec3 p_W_m, Vec3 motion) const {
    if (TouchingPlanes::depth(p_W_m) > depthIn(model, p_W_m)) return model.plane_normal;
    return TouchingPlanes::normal(p_W_m, motion);
  }

  [[nodiscard]] Rest rest(Vec3 proxy_W_m, Vec3 to_tip) const {
    return restFrom(normal(proxy_W_m, to_tip), proxy_W_m, to_tip);
  }

  // the plane that the way crosses first
  bool meets(Vec3 from_W_m, Vec3 to_W_m, Vec3& at_W_m) const {
    double first = 2.0;
    for (const BonePlane& plane : planes) {
      const double gap_m = std::max(0.0, -below(plane, from_W_m));
      const double end_gap_m = -below(plane, to_W_m);
      if (end_gap_m < 0.0) first = std::min(first, gap_m / (gap_m - end_gap_m));
    }
    if (first > 1.0) return false;
    at_W_m = from_W_m + (to_W_m - from_W_m) * first;
    return true;
  }
};

}  // namespace

void useBonePlanes(const BonesNear& bones, SceneModel& model) {
  assert(model.isLive(Effect::kBone) && model.is_plane && bones.count <= kMaxBonePlanes);
  model.bone_planes = bones.planes;
  model.bone_plane_count = static_cast<std::uint32_t>(bones.count);
  model.hold = bones.count > 0 ? holdTip<BonePlanes> : nullptr;
  std::uint32_t others = 0;
  for (std::uint32_t i = 0; i < model.stage_count; ++i)
    if (model.stages[i] != effectEntry(Effect::kBone).stage) model.stages[others++] = model.stages[i];
  model.stage_count = others;
  if (bones.count > 0) model.stages[model.stage_count++] = pressBone<BonePlanes>;
  if (model.hold != nullptr)
    model.step_function = stepHeld;
  else if (model.stage_count > 0)
    model.step_function = stepWithStages;
  else
    model.step_function = model.placed_step;
}

const BonePlane& touchedPlane(const SceneModel& model, const SimState& state) {
  assert(state.bone.touching);
  return BonePlanes(model).deepestAt(state.bone.p_proxy_W_m);
}

}  // namespace needlelab
