/// BONE in a body: a few bones near the tip, each as the plane that touches it (bone_contact.h has the
/// contact).
#include "common/haptics/body/bone_planes.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include "common/haptics/effects/bone_contact.h"

namespace needlelab {
namespace {

using namespace bone_contact;

double below(const BonePlane& plane, Vec3 p_W_m) {
  return -dot(plane.normal, p_W_m - plane.point_m);
}

// the deepest plane; the model has at least one
const BonePlane& planeAt(const SceneModel& model, Vec3 p_W_m) {
  assert(model.bone_plane_count > 0);
  const BonePlane* deepest = &model.bone_planes[0];
  for (std::uint32_t i = 1; i < model.bone_plane_count; ++i)
    if (below(model.bone_planes[i], p_W_m) > below(*deepest, p_W_m)) deepest = &model.bone_planes[i];
  return *deepest;
}

// Bones as half-spaces, which a body's skin ends.
struct BonePlanes {
  static constexpr bool kIsConvex = false;

  static double depth(const SceneModel& model, Vec3 p_W_m) {
    return std::min(below(planeAt(model, p_W_m), p_W_m), depthIn(model, p_W_m));
  }

  static Vec3 normal(const SceneModel& model, Vec3 p_W_m, Vec3 /*motion*/) {
    const BonePlane& plane = planeAt(model, p_W_m);
    return below(plane, p_W_m) <= depthIn(model, p_W_m) ? plane.normal : model.plane_normal;
  }

  // the plane that the way crosses first
  static bool meets(const SceneModel& model, Vec3 from_W_m, Vec3 to_W_m, Vec3& at_W_m) {
    double first = 2.0;
    for (std::uint32_t i = 0; i < model.bone_plane_count; ++i) {
      const double gap_m = std::max(0.0, -below(model.bone_planes[i], from_W_m));
      const double end_gap_m = -below(model.bone_planes[i], to_W_m);
      if (end_gap_m < 0.0) first = std::min(first, gap_m / (gap_m - end_gap_m));
    }
    if (first > 1.0) return false;
    at_W_m = from_W_m + (to_W_m - from_W_m) * first;
    return true;
  }

  static Rest rest(const SceneModel& model, Vec3 proxy_W_m, Vec3 to_tip) {
    Rest found{normal(model, proxy_W_m, to_tip), false, {}};
    // on several bones: the one that the tip presses most
    double most_m = -std::numeric_limits<double>::infinity();
    for (std::uint32_t i = 0; i < model.bone_plane_count; ++i) {
      const BonePlane& plane = model.bone_planes[i];
      if (below(plane, proxy_W_m) < -kOnSurface_m || -dot(plane.normal, to_tip) <= most_m) continue;
      most_m = -dot(plane.normal, to_tip);
      found.normal = plane.normal;
    }
    const Vec3 along = to_tip + found.normal * std::max(0.0, -dot(found.normal, to_tip));
    for (std::uint32_t i = 0; i < model.bone_plane_count; ++i) {
      const BonePlane& plane = model.bone_planes[i];
      if (below(plane, proxy_W_m) < -kOnSurface_m || !(dot(plane.normal, along) < 0.0)) continue;
      const Vec3 edge = cross(found.normal, plane.normal);
      const double size = norm(edge);
      if (!(size > 1e-6)) continue;
      found.on_edge = true;
      found.edge = edge / size;
    }
    return found;
  }

  // only planes that the proxy is outside of: it does not enter one, but a plane that came over it may hold
  // it
  static Vec3 clipped(const SceneModel& model, Vec3 proxy_W_m, Vec3 step) {
    double share = 1.0;
    for (std::uint32_t i = 0; i < model.bone_plane_count; ++i) {
      const double from_m = below(model.bone_planes[i], proxy_W_m);
      const double to_m = below(model.bone_planes[i], proxy_W_m + step);
      if (from_m > kOnSurface_m || to_m <= kOnSurface_m) continue;
      share = std::min(share, std::max(0.0, -from_m) / (to_m - from_m));
    }
    return step * share;
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
  return planeAt(model, state.bone.p_proxy_W_m);
}

}  // namespace needlelab
