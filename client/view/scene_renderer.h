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

/// The content to draw. Plain data; a frame that looks the same (within a few hundredths of a mm) is not
/// drawn again.
struct SceneFrame {
  Moment
      moment;  ///< value-initialised (tick 0, outside at the origin): no needle when `show_needle` is false
  bool show_needle = true;
  AidSet aids = usualAidSet();
  OrbitCamera camera;
  std::optional<Moment> second;       ///< another gesture as an overlay: a needle in kSecondGesture
  std::vector<TipTrail> trails;       ///< lines over the picture (sceneWidget only)
  std::optional<PlanView> plan_W;     ///< the exercise's, with the aid PLANNED_LINE (sceneWidget only)
  bool cut_open = true;               ///< with the aid TISSUES: removes the half toward the eye
  double arrow_extents_per_N = 0.22;  ///< length of force arrows, in the scene's extents
};

/// Draws into its own texture. Needs the surface's context for its whole life. Thread: the surface's.
class SceneRenderer {
 public:
  /// `samples`: of multisampling, 1 or 4. Errors: kUnavailable when the shaders do not compile on this
  /// machine.
  static Result<std::unique_ptr<SceneRenderer>> make(int samples = 4);
  ~SceneRenderer();
  SceneRenderer(const SceneRenderer&) = delete;
  SceneRenderer& operator=(const SceneRenderer&) = delete;

  /// Makes the meshes; takes a few ms.
  void setScene(std::shared_ptr<const SceneView> scene);
  [[nodiscard]] const SceneView* scene() const;

  /// Draws at this size if something has changed since the last call. Returns whether it drew.
  bool draw(const SceneFrame& frame, int width_px, int height_px);
  /// Texture for ImGui::Image, upside down (uv from 0,1 to 1,0). Valid until the next `draw`.
  [[nodiscard]] ImTextureID texture() const;
  /// Copies the last drawing to `corner_px` pixel by pixel: cheaper than ImGui::Image. Call it once per
  /// frame; the renderer must live until the frame has ended.
  void show(ImDrawList& list, ImVec2 corner_px);
  /// Returns the last drawing, rows from top to bottom, for tests and reports.
  [[nodiscard]] RgbaImage picture() const;
  /// Returns the duration of the last drawing, in s: until the pixels were complete with `wait_for_pixels`
  /// (for benchmarks, because it delays the frame), else until the driver had the commands.
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
  ImVec2 corner_px, size_px;  ///< the picture's place on the surface
};
struct SceneWidgetOptions {
  bool mouse_moves_camera = true;
  bool labels = true;  ///< names of layers, target, hazards (as the aids allow)
  bool legend = true;  ///< of the planned line; of the force arrows, with numbers
};
/// Draws the scene and shows it in the current window, `size_px` large (0: the rest); labels and legend over
/// it. Changes `frame.camera` with the mouse.
SceneWidgetResult sceneWidget(const char* id, SceneRenderer& renderer, SceneFrame& frame, ImVec2 size_px,
                              const SceneWidgetOptions& options = {});

}  // namespace needlelab
