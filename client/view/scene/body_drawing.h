/// Drawing of a body: skin, bones, other structures, the cut. Private to this folder.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "client/view/gl_objects.h"
#include "client/view/model/body/body_section.h"
#include "client/view/model/body_view.h"
#include "client/view/scene/scene_frame.h"

namespace needlelab {

/// What every program needs to know of the view.
struct ViewOfScene {
  Matrix4 view_projection{};
  Vec3 eye_W_m, light_W, up_W;  ///< towards the light, unit; up in the picture
  double width_per_height = 1;
};

/// One program for each way of drawing: a software renderer computes both sides of a branch.
class BodyDrawing {
 public:
  /// Errors: kUnavailable, with the driver's message.
  Status build();
  /// `scene` has a body. Makes the meshes: 0.1 to 0.3 s.
  void setScene(const SceneView& scene);
  /// Everything that does not move with the needle. `cut`: the half before it is removed; `see_through`: the
  /// skin is glass over the bones. `in_haste`: a coarser cut, no decoration.
  void drawStill(const SceneView& scene, const SceneFrame& frame, const ViewOfScene& view,
                 const std::optional<PicturePlane>& cut, bool see_through, bool in_haste);
  void drawHand(const ViewOfScene& view, const OrbitCamera& camera, const Moment& moment);
  /// Corners of a box around the hand, in W.
  [[nodiscard]] std::array<Vec3, 8> handBox(const OrbitCamera& camera, const Moment& moment) const;
  /// Computes where the instrument's shadow falls on the skin; returns its points. `drawShadow` draws it.
  const Mesh& makeShadow(const SceneView& scene, const ViewOfScene& view, const Moment& moment,
                         const SyringeMesh& syringe);
  void drawShadow(const ViewOfScene& view, const std::optional<PicturePlane>& cut);
  /// Where the names of the structures in the last cut belong.
  [[nodiscard]] const std::vector<BodySection::Name>& names() const { return names_; }

 private:
  struct Part {
    StructureIndex structure = kOutside;
    Rgb colour;
    bool line = false;
    GlMesh mesh;
  };
  /// A cut that was drawn, and for what.
  struct Cut {
    std::vector<double> key;
    Texture picture;
    SectionFrame frame_W;
    std::vector<BodySection::Name> names;
  };
  void drawSkin(const GlProgram& program, const SceneView& scene, const Rgb& colour, float opacity) const;
  void drawCut(const SceneView& scene, const SceneFrame& frame, const ViewOfScene& view,
               const PicturePlane& plane, bool in_haste);

  GlProgram skin_, dimpled_, tissue_, ghost_, inside_, section_, shadow_;
  GlMesh skin_mesh_, far_skin_, bones_, hand_, square_, shadow_gl_;
  Mesh shadow_mesh_;
  std::vector<std::unique_ptr<Part>> parts_;
  Cut fine_, quick_;
  Matrix4 body_{};  // X_WL
  std::vector<BodySection::Name> names_;
  Vec3 hand_low_m_, hand_high_m_;
};

}  // namespace needlelab
