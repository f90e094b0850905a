/// An ultrasound-like picture of the scene in the needle's plane: layers with speckle, a bright needle, a
/// shadow behind bone. For teaching; not a simulation of sound.
#pragma once

#include <string>
#include <vector>

#include "client/view/model/gesture_replica.h"
#include "client/view/model/mesh.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

/// The picture's pose in W. `origin_W_m`: middle of its upper edge, on the skin under the probe.
struct SlicePlane {
  Vec3 origin_W_m;
  Vec3 right_W;  ///< unit, to the right in the picture
  Vec3 down_W;   ///< unit, into the tissue
  friend constexpr bool operator==(const SlicePlane&, const SlicePlane&) = default;
};

/// Returns a probe's plane: it contains the needle and the surface normal at the entry (before entry: at the
/// surface point below the tip). If the needle is almost along the normal, uses the plane of `before`, or W's
/// x without one. The plane turns by at most 0.2 rad from `before`, so the picture neither spins nor flips.
SlicePlane slicePlaneOf(const SceneView& scene, const Moment& moment, const SlicePlane* before = nullptr);

/// The same plane for `offPlane_m`. The viewer is on the side of right_W × down_W.
PicturePlane picturePlaneOf(const SlicePlane& plane);

/// A hazard's name and its position in the picture.
struct SliceLabel {
  double right_m = 0, down_m = 0;  ///< from the middle of the upper edge
  std::string text;                ///< as hazardLabel
  pb::Hazard::Kind kind = pb::Hazard::OTHER;
  double opacity = 1;  ///< as offPlaneOpacity
};
/// Returns the labels of hazards that lie in a picture of this half width and depth, in the scene's order.
/// Each label is at the hazard's point nearest to the plane.
std::vector<SliceLabel> sliceLabels(const SceneView& scene, const SlicePlane& plane, double half_width_m,
                                    double depth_m);

struct SliceSettings {
  int width = 280, height = 320;  ///< pixels, 16-1024 each
  double depth_m = 0;             ///< of the lower edge; 0: a third beyond the deepest target, at most 12 cm
};
double sliceDepth_m(const SceneView& scene, const SliceSettings& settings);

/// In a body: the structures that the plane cuts. Off-plane parts of a hazard shine through faintly, by
/// `offPlaneOpacity`, and stop no sound. Pure: the same inputs give the same bytes. Costs about 20-60 ns per
/// pixel, 60-120 in a body; the caller measures and shows it. Thread: any.
void drawSlice(const SceneView& scene, const SlicePlane& plane, const Moment& moment,
               const SliceSettings& settings, GreyImage& out);

}  // namespace needlelab
