/// The profile's limb, targets and hazards, placed in W, and distances to them: for scores and for the
/// windows.
#pragma once

#include <string>
#include <vector>

#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A ball (a = b), or all points within `radius_m` of the segment a-b.
struct Region {
  std::string name;
  Vec3 a_W_m, b_W_m;
  double radius_m = 0;
};

struct Anatomy {
  Limb limb;
  bool has_limb = false;
  std::vector<Region> targets;
  std::vector<Region> hazards;
};

/// `X_WL` as for `sceneSpecOf`; its quaternion is normalised. A profile without a limb (never from
/// `parseProfile`) has none.
Anatomy anatomyOf(const pb::Profile& profile, const Pose& X_WL);

/// Least distance between the segments p-q and a-b (Lumelsky's clamped solution; either may be a point).
double segmentDistance(Vec3 p, Vec3 q, Vec3 a, Vec3 b);

/// Distance from the region's surface, in W; negative inside. For a point, and for a straight shaft between
/// two points.
double distanceTo(const Region& region, Vec3 p_W_m);
double distanceTo(const Region& region, Vec3 tip_W_m, Vec3 skin_W_m);

}  // namespace needlelab
