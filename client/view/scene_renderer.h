/// The 3-D scene: limb cut open, needle and syringe, guides, force arrows, target and hazards.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <imgui/imgui.h>

#include "client/view/model/camera.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/image.h"
#include "client/view/model/palette.h"
#include "client/view/model/scene_view.h"
#include "common/base/result.h"

namespace needlelab {

/// A path of the tip to be drawn as a line.
struct TipTrail {
  std::vector<Vec3> points_W_m;
  Rgb colour = kSkyBlue;
};

/// What to draw now. Plain data; frames that look the same (to a few hundredths of a mm) are not drawn again.
struct SceneFrame {
  Moment
      moment;  ///< value-initialised (tick 0, outside at the origin): no needle when `show_needle` is false
  bool show_needle = true;
  AidSet aids = usualAidSet();
  OrbitCamera camera;
  std::optional<Moment> second;       ///< another gesture laid over this one: a needle in kSecondGesture
  std::vector<TipTrail> trails;       ///< lines over the picture (sceneWidget only)
  bool cut_open = true;               ///< with the aid TISSUES: the half toward the eye is taken away
  double arrow_extents_per_N = 0.22;  ///< length of force arrows, in the scene's extents
};

/// Draws into a texture of its own. Needs the surface's context for its whole life. Thread: the surface's.
class SceneRenderer {
 public:
  /// Errors: kUnavailable, when the shaders do not compile here. `samples`: of multisampling, 1 or 4.
  static Result<std::unique_ptr<SceneRenderer>> make(int samples = 4);
  ~SceneRenderer();
  SceneRenderer(const SceneRenderer&) = delete;
  SceneRenderer& operator=(const SceneRenderer&) = delete;

  /// Makes the meshes; a few ms.
  void setScene(std::shared_ptr<const SceneView> scene);
  [[nodiscard]] const SceneView* scene() const;

  /// Draws at that size, unless nothing has changed since the last time. Returns whether it drew.
  bool draw(const SceneFrame& frame, int width_px, int height_px);
  /// For ImGui::Image (turned upside down: uv from 0,1 to 1,0). Valid until the next `draw`.
  [[nodiscard]] ImTextureID texture() const;
  /// Puts the last drawing there, pixel by pixel: cheaper than ImGui::Image. Once a frame; the
  /// renderer must live until that frame has ended.
  void show(ImDrawList& list, ImVec2 corner_px);
  /// The last drawing, rows from top to bottom: for tests and reports.
  [[nodiscard]] RgbaImage picture() const;
  /// The duration of the last drawing, in s: until the pixels were complete when `wait_for_pixels` is set
  /// (for benchmarks: it holds up the frame), else until it was handed to the driver.
  [[nodiscard]] double lastDraw_s() const;
  bool wait_for_pixels = false;

 private:
  struct Parts;
  explicit SceneRenderer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

/// The user's actions on the widget.
struct SceneWidgetResult {
  bool camera_moved = false;  ///< `frame.camera` was changed by a drag (left: turn, right: shift), wheel or
                              ///< double click (first look)
  bool hovered = false;
  ImVec2 corner_px, size_px;  ///< where the picture stands on the surface
};
struct SceneWidgetOptions {
  bool mouse_moves_camera = true;
  bool labels = true;  ///< names of layers, target, hazards (those that the aids allow)
  bool legend = true;  ///< of the force arrows, with numbers
};
/// Draws the scene and shows it in the current window, `size_px` large (0: the rest); labels and legend over
/// it. Changes `frame.camera` with the mouse.
SceneWidgetResult sceneWidget(const char* id, SceneRenderer& renderer, SceneFrame& frame, ImVec2 size_px,
                              const SceneWidgetOptions& options = {});

}  // namespace needlelab
