#include "client/instructor/model/live/depth_picture.h"

#include "client/instructor/model/live/session_scene.h"
#include "common/profile/profile.h"

namespace needlelab {

DepthPicture depthPictureOf(const SceneView& scene, const std::optional<PlannedLine>& plan_W) {
  DepthPicture picture;
  picture.depth_m = ladderDepth_m(scene);
  const NeedleLine line = plan_W ? NeedleLine{plan_W->entry_m, plan_W->direction} : lineToTarget(scene);
  const TissuesOnLine way = tissuesOnLine(scene, line, picture.depth_m);
  for (const TissuesOnLine::Tissue& tissue : way.tissues)
    picture.bands.push_back(
        {scene.layers[static_cast<std::size_t>(tissue.layer)].colour, tissue.top_m, tissue.bottom_m});
  for (const TissuesOnLine::Aim& aim : way.targets)
    if (aim.bottom_m > aim.top_m) picture.targets.push_back({kYellow, aim.top_m, aim.bottom_m});
  return picture;
}

Result<DepthPicture> depthPictureOf(const pb::SessionDescription& description, const pb::Exercise* exercise) {
  ASSIGN_OR_RETURN(const pb::Profile profile,
                   parseProfile(description.profile_json(), "the session's profile"));
  ASSIGN_OR_RETURN(const Pose X_WL, placementOf(description));
  ASSIGN_OR_RETURN(const SceneView scene, sceneViewOf(profile, X_WL));
  return depthPictureOf(scene, exercise == nullptr ? std::nullopt : planOn(scene, *exercise));
}

}  // namespace needlelab
