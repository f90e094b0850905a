/// The scene renderer's parts. Private to this folder.
#pragma once

#include <memory>
#include <vector>

#include "client/view/gl_objects.h"
#include "client/view/model/image.h"
#include "client/view/model/mesh.h"
#include "client/view/model/scene_view.h"
#include "client/view/scene_renderer.h"

namespace needlelab {

/// The cone of α, outside, from the entry toward the hub.
struct GuideCone {
  double height_m = 0, radius_m = 0;
};

/// `still`: everything that rests while only the needle moves; `picture`: that and the needle.
struct SceneBuffers {
  explicit SceneBuffers(int samples) : still(samples), picture(samples) {}
  FrameBuffer still, picture;
};

/// The limb costs most and does not move: it is drawn once for a camera and kept with its depths. Each
/// drawing restores what the needle covered the last time and draws the needle where it is now. While the
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

  // of the current drawing
  const SceneFrame* frame = nullptr;
  Vec3 cut_place_W_m, cut_normal_W;
  bool open = false;  ///< the half toward the eye is taken away

  /// `limb_too`: draws everything; else only the moving parts.
  void drawInto(SceneBuffers& buffers, const SceneFrame& now, int width_px, int height_px, bool limb_too);
  /// `in_haste`: leaves out decoration.
  void drawStill(bool in_haste);
  void drawMoving();
  /// The rectangle of all that `drawMoving` draws.
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
/// The pose at `p` with its z along the unit vector `axis`.
Pose poseTowards(Vec3 p, Vec3 axis);

inline constexpr int kTableDepths = 768, kTableAlong = 128;
inline constexpr double kTablePeriod_m = 0.024;  ///< along the layers, then it repeats

/// The tissues' colours over depth, as a picture for the cut. x: depth from 0 to `deepest_m`; y: along the
/// layers, without a seam. Each tissue has its colour and a grain of its own (lobes of fat, fibres of muscle
/// and tendon); layers end with a dark line. Deterministic.
RgbaImage tissueTable(const SceneView& scene, double deepest_m);
/// The last layer's bottom.
double deepestLayer_m(const SceneView& scene);

}  // namespace needlelab
