/// Internals of the scene renderer. Private to this folder.
#pragma once

#include <memory>
#include <vector>

#include <imgui/imgui.h>

#include "client/view/gl_objects.h"
#include "client/view/model/body/tissue_grain.h"
#include "client/view/model/mesh.h"
#include "client/view/model/scene_view.h"
#include "client/view/scene/body_drawing.h"
#include "client/view/scene/scene_frame.h"

namespace needlelab {

/// `still`: everything except the moving needle; `picture`: `still` plus the needle.
struct SceneBuffers {
  explicit SceneBuffers(int samples) : still(samples), picture(samples) {}
  FrameBuffer still, picture;
};

/// The limb costs most and does not move, so it is drawn once per camera position and kept with its depths.
/// Each drawing restores the area that the needle covered and draws the needle at its new pose. While the
/// camera moves, everything is drawn each time, with one sample per pixel.
struct SceneParts {
  explicit SceneParts(int samples) : fine(samples), quick(1), has_quick(samples > 1) {}

  SceneBuffers fine, quick;
  bool has_quick;
  SceneBuffers* shown = nullptr;              ///< holds the last drawing
  std::vector<double> still_key, moving_key;  ///< of the last drawing
  bool still_changed_before = false;          ///< by the previous call: the camera is moving
  PixelRect covered;                          ///< by the moving parts, in the last drawing
  GlProgram solid, section, backdrop;
  Texture table;
  GlMesh unit_square, ball, arrow, ring, skin, cap;
  GlMesh needle, hub, barrel, marks, plunger, liquid;
  std::vector<std::unique_ptr<GlMesh>> hazards;
  SyringeMesh syringe;
  std::shared_ptr<const SceneView> scene;
  BodyDrawing body;  ///< if the scene has one
  double last_draw_s = 0;
  ImVec2 shown_corner_px;  ///< the picture's corner on the surface

  // of the current drawing
  const SceneFrame* frame = nullptr;
  PicturePlane insertion_plane;
  Vec3 cut_place_W_m, cut_normal_W;
  ViewOfScene seen;
  bool open = false;  ///< the half facing the eye is removed

  /// `limb_too`: draws everything; otherwise only the moving parts.
  void drawInto(SceneBuffers& buffers, const SceneFrame& now, int width_px, int height_px, bool limb_too);
  /// `in_haste`: skips decoration.
  void drawStill(bool in_haste);
  void drawMoving();
  /// Returns the rectangle that `drawMoving` covers.
  [[nodiscard]] PixelRect movingRect(int width_px, int height_px);
  /// The plane that cuts a body open; none if it is closed, or no body.
  [[nodiscard]] std::optional<PicturePlane> bodyCut() const;
  void drawEntryMark();
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
  /// Draws a mesh with the solid program.
  void put(const GlMesh& mesh, const Matrix4& model, Rgb colour, float opacity, float shine = 0.25F,
           float rim = 0) const;
};

/// Returns the scaling and pose transform from a frame (T, L …) to W.
Matrix4 modelMatrix(const Pose& X, Vec3 scale = {1, 1, 1});
/// Returns a pose at `p` with its z along the unit vector `axis`.
Pose poseTowards(Vec3 p, Vec3 axis);

inline constexpr int kTableDepths = 768, kTableAlong = 128;
inline constexpr double kTablePeriod_m = kGrainPeriod_m;

/// Returns the tissues' colours over depth, as a texture for the cut. x: depth from 0 to `deepest_m`; y:
/// along the layers, seamless. Each tissue has its own colour and grain (fat lobules, fibres of muscle and
/// tendon); a dark line ends each layer. Deterministic.
RgbaImage tissueTable(const SceneView& scene, double deepest_m);
/// Returns the last layer's bottom.
double deepestLayer_m(const SceneView& scene);

}  // namespace needlelab
