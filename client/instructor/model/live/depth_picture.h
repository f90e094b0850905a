/// The tissues on an exercise's way in, as a column: what a station's tile shows of a lesson.
#pragma once

#include <optional>
#include <vector>

#include "client/view/model/scene_view.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Lengths are along the needle, from where it goes in.
struct DepthPicture {
  struct Band {
    Rgb colour;
    double top_m = 0, bottom_m = 0;
  };
  std::vector<Band> bands, targets;
  double depth_m = 0.05;  ///< how deep the column shows
};

/// Of the planned line; without one, of the way to the first target.
DepthPicture depthPictureOf(const SceneView& scene, const std::optional<PlannedLine>& plan_W);

/// Of a session that a server sent; `exercise`: null if unknown. Errors: kInvalidInput if its profile or its
/// placement cannot be read.
Result<DepthPicture> depthPictureOf(const pb::SessionDescription& description, const pb::Exercise* exercise);

}  // namespace needlelab
