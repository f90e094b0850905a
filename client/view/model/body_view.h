/// A body for display: its meshes, and the plane that cuts it open.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "client/view/model/camera.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/mesh.h"
#include "client/view/model/palette.h"
#include "client/view/model/scene_view.h"
#include "common/profile/structure_kinds.h"

namespace needlelab {

/// Sets focus and extent of a view of a body: the origin of L if the skin is there, otherwise the skin above
/// the first target.
void frameBody(SceneView& view);

/// About how many triangles a body has. Solids that would need more are in the section only.
struct BodyMeshBudget {
  std::size_t skin = 14'000, far_skin = 9'000, bones = 30'000, solids = 34'000, lines = 8'000;
};

/// In L; all but `far_skin` near the focus. A normal's length, (0, 1], is how open the surface is to light
/// from all around.
struct BodyMeshes {
  struct Part {
    StructureIndex structure = kOutside;
    Mesh mesh;
  };
  Mesh skin, bones;
  Mesh far_skin;            ///< coarse, where the body goes on beyond the ball; overlaps `skin` by a cell
  std::vector<Part> parts;  ///< solids and lines
  [[nodiscard]] std::size_t triangles() const;
};
/// `scene` has a body. Takes 0.1 to 0.3 s. Thread: any.
BodyMeshes bodyMeshesOf(const SceneView& scene, const BodyMeshBudget& budget = {});
/// Meshes but the far skin end this far from the focus, along the axes; a ball inside of that is drawn, with
/// clean ends.
double bodyReach_m(const SceneView& scene);
double bodyBall_m(const SceneView& scene);

/// The plane that cuts a body open: through the needle's line once it is inside, otherwise through the
/// planned line, otherwise upright through the focus; turned about that line to face the eye, and half a
/// needle behind it, so that the needle lies on the cut.
PicturePlane bodyCutOf(const SceneView& scene, const OrbitCamera& camera, const Moment* inside,
                       const PlanView* plan);

/// Skin pressed in where a needle has gone in, exp(−r²/(2σ²)) deep.
struct Dimple {
  Vec3 place_W_m, normal_W;
  double depth_m = 0, sigma_m = 0;
};
std::optional<Dimple> dimpleOf(const SceneView& scene, const Moment& moment);

}  // namespace needlelab
