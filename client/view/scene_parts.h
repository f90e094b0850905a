/// What the scene renderer holds. Private to this folder.
#pragma once

#include <memory>
#include <vector>

#include "client/view/frame_buffer.h"
#include "client/view/gl_program.h"
#include "client/view/model/mesh.h"
#include "client/view/scene_renderer.h"
#include "client/view/texture.h"

namespace needlelab {

/// The cone of α, outside, from the entry toward the hub.
struct GuideCone {
  double height_m = 0, radius_m = 0;
};

/// What stands still while only the needle moves, and the picture: that and the needle.
struct SceneBuffers {
  explicit SceneBuffers(int samples) : still(samples), picture(samples) {}
  FrameBuffer still, picture;
};

/// The limb costs most, and stands still: it is drawn once for a camera, and kept with its depths. Each
/// drawing takes back what the needle covered the last time and draws the needle where it is now. While the
/// camera moves the whole is drawn each time, without several samples a pixel.
struct SceneRenderer::Parts {
  explicit Parts(int samples) : fine(samples), quick(1), has_quick(samples > 1) {}

  SceneBuffers fine, quick;
  bool has_quick;
  SceneBuffers* shown = nullptr;              ///< the one with the last drawing
  std::vector<double> still_key, moving_key;  ///< of the last drawing
  bool still_changed_before = false;          ///< in the last call: the camera moves
  PixelRect covered;                          ///< by the needle and what belongs to it, in the last drawing
  GlProgram solid, section, backdrop;
  Texture table;
  GlMesh unit_square, ball, arrow, cone, ring, skin;
  GlMesh needle, hub, barrel, marks, plunger, liquid;
  std::vector<std::unique_ptr<GlMesh>> hazards;
  SyringeMesh syringe;
  std::shared_ptr<const SceneView> scene;
  double last_draw_s = 0;
  ImVec2 shown_corner_px;  ///< where the widget puts the picture on the surface

  // of the drawing under way
  const SceneFrame* frame = nullptr;
  Vec3 cut_place_W_m, cut_normal_W;
  bool open = false;  ///< the half toward the eye is taken away

  /// `limb_too`: from nothing; else only what moves.
  void drawInto(SceneBuffers& buffers, const SceneFrame& now, int width_px, int height_px, bool limb_too);
  /// `in_haste`: without what only makes it pretty.
  void drawStill(bool in_haste);
  void drawMoving();
  /// Of all that `drawMoving` draws.
  [[nodiscard]] PixelRect movingRect(int width_px, int height_px) const;
  [[nodiscard]] GuideCone guideCone() const;
  void drawBackdrop();
  void setView(int width_px, int height_px);
  void drawSkin();
  void drawSection();
  void drawAnatomy(float opacity);
  void drawInstrument(const Moment& moment, Rgb steel, float opacity);
  void drawGlass(const Moment& moment);
  void drawGuides();
  void drawArrows();
  void drawFrontSkin();
  /// One mesh in the solid program.
  void put(const GlMesh& mesh, const Matrix4& model, Rgb colour, float opacity, float shine = 0.25F,
           float rim = 0) const;
};

/// From T's, L's … own coordinates to W, with sizes.
Matrix4 modelMatrix(const Pose& X, Vec3 scale = {1, 1, 1});
/// The pose at `p` whose z looks along the unit vector `axis`.
Pose poseTowards(Vec3 p, Vec3 axis);

}  // namespace needlelab
