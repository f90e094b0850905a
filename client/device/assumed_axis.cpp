#include "client/device/assumed_axis.h"

#include "common/haptics/surface.h"

namespace needlelab {
namespace {

// the shortest rotation from +z to `axis`, which is not near −z
Quat shortest(Vec3 axis) {
  return normalized(Quat{-axis.y, axis.x, 0, 1 + axis.z});
}

}  // namespace

Quat rotationOfAxis(Vec3 axis) noexcept {
  // needles point down, most of them: from −z, reached by half a turn about x, the way is short
  if (axis.z > 0) return shortest(axis);
  return Quat{1, 0, 0, 0} * shortest({axis.x, -axis.y, -axis.z});
}

Quat AssumedAxis::at(const SceneModel& model, const SimState& before, Vec3 p_WT_m) const noexcept {
  const double depth_m = signedDepth(model.limb, p_WT_m);
  const bool inside = depth_m > 0;
  if (inside && before.inside) return kept_;
  const bool enters = inside && before.outside_once;
  // at a sphere's very centre, without a motion, any direction will do
  Vec3 motion = p_WT_m - before.p_prev_W_m;
  if (normSquared(motion) == 0) motion = {0, 0, -1};
  const Vec3 at = enters ? entryPoint(before, p_WT_m, depth_m) : p_WT_m;
  return rotationOfAxis(-surfaceNormal(model.limb, at, motion));
}

}  // namespace needlelab
