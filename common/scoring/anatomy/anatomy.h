/// The profile's limb, targets and hazards, placed in W, and distances to them; for scores and windows.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

class StructureRegion;

/// A ball (a = b), or all points within `radius_m` of the segment a-b; or a structure of a volume, which also
/// has a ball: the point that the author gave to aim at, or its deepest one (common/anatomy/inner_point.h),
/// and about how far its surface is from there. The ball is for all that needs a centre; distances are the
/// structure's own.
struct Region {
  std::string name;
  Vec3 a_W_m, b_W_m;
  double radius_m = 0;
  std::shared_ptr<const StructureRegion> structure = nullptr;  ///< null: a shape
};

/// A range of depths under the surface, along its normal; empty if top ≥ bottom.
struct DepthSpan {
  double top_m = 0, bottom_m = 0;
};

/// A ball, and the layers that count. A point is in the target if it is in both. Or a structure alone.
struct Target {
  Region ball;
  std::vector<DepthSpan> tissues;  ///< depths of the layers that count, from the skin inward; empty: all
  std::shared_ptr<const StructureRegion> tissue_region = nullptr;  ///< in a volume, in place of `tissues`
};

struct Anatomy {
  Limb limb;
  bool has_limb = false;
  /// Depths of the layers' lower boundaries; the last layer has no end. Empty in a volume: depth does not
  /// tell the structure.
  std::vector<double> layer_end_m;
  std::vector<Target> targets;
  std::vector<Region> hazards;
  std::shared_ptr<const StructureRegion> landmark = nullptr;  ///< the bone to find by PALPATION; null: none
};

/// `X_WL` as for `sceneSpecOf`; its quaternion is normalised. A profile without a limb (never from
/// `parseProfile`) gives an anatomy without one.
Anatomy anatomyOf(const pb::Profile& profile, const Pose& X_WL);

/// Depth below the nearest skin, negative outside (depthBelowSkin); 0 without a limb.
double depthAt(const Anatomy& anatomy, Vec3 p_W_m);
/// Whether that is above 0; fast.
bool isUnderSkin(const Anatomy& anatomy, Vec3 p_W_m);
/// The index of the layer, in a volume of the structure, at a point; −1 outside. Scores, events and views all
/// use this.
int layerAt(const Anatomy& anatomy, Vec3 p_W_m);
/// As layerAt, for a limb in W and the depths of its layers (none in a volume).
int layerAt(const Limb& limb_W, std::span<const double> layer_end_m, Vec3 p_W_m);
/// As layerAt, for a depth under layers; −1 without layers, as in a volume.
int layerAtDepth(std::span<const double> layer_end_m, double depth_m);

/// Distance from a target: the greater of the distances from the ball and from the tissues; negative inside.
/// (The signed distance of an intersection is at least the greatest of its parts' distances, and has its
/// sign.) From a structure, its own.
double distanceTo(const Anatomy& anatomy, const Target& target, Vec3 p_W_m);
/// The target's range of depths at its centre: the ball's, limited to the tissues. In a volume, the depths
/// where the line through the centre along the skin's normal enters and leaves the target.
DepthSpan depthSpanOf(const Anatomy& anatomy, const Target& target);
/// Where the tip of a straight needle from `entry_W_m` (or along the normal if absent) must be for an
/// injection into the target. Tip and opening (`opening_behind_tip_m` behind the tip) are equally far from
/// the ends of the target's depth span; if the span is too short for both, the opening is in its middle.
Vec3 tipForTarget(const Anatomy& anatomy, const Target& target, double opening_behind_tip_m,
                  std::optional<Vec3> entry_W_m);

/// Minimum distance between the segments p-q and a-b (Lumelsky's clamped solution; either may be a point).
double segmentDistance(Vec3 p, Vec3 q, Vec3 a, Vec3 b);

/// Distance from the region's surface, in W; negative inside. The first form is for a point, the second for a
/// straight shaft between two points; from a structure, it has the right sign, and its value only if it is
/// above 0.
double distanceTo(const Region& region, Vec3 p_W_m);
double distanceTo(const Region& region, Vec3 tip_W_m, Vec3 skin_W_m);

}  // namespace needlelab
