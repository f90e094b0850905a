/// A body's cut as a picture, and where in it the names belong.
#pragma once

#include <optional>

#include "client/view/model/body_view.h"
#include "client/view/model/mesh.h"
#include "common/anatomy/field_section.h"

namespace needlelab {

struct BodySection {
  SectionFrame frame_W;  ///< in W; its rows go up
  RgbaImage picture;     ///< rows from bottom to top; opacity 0 outside of the skin
  struct Name {
    StructureIndex structure = kOutside;
    Vec3 place_W_m;
  };
  std::vector<Name> names;  ///< of the structures in it
};

/// The part of `plane` that the camera sees, at most bodyReach_m from the focus; `long_px` points along its
/// longer side. `dimple`: pressed in there, as the skin's mesh is.
BodySection bodySectionOf(const SceneView& scene, const PicturePlane& plane, const OrbitCamera& camera,
                          double width_per_height, int long_px, const std::optional<Dimple>& dimple);

}  // namespace needlelab
