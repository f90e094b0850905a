/// The 3-D scene: limb cut open, needle and syringe, guides, force arrows, target and hazards.
#pragma once

#include <memory>

#include <imgui/imgui.h>

#include "client/view/model/body/body_section.h"
#include "client/view/model/mesh.h"
#include "client/view/scene/scene_frame.h"
#include "common/base/result.h"

namespace needlelab {

struct SceneParts;

/// Draws into its own texture. Needs the surface's context for its whole life. Thread: the surface's.
class SceneRenderer {
 public:
  /// `samples`: multisampling, 1 or 4. Errors: kUnavailable if the shaders do not compile on this machine.
  static Result<std::unique_ptr<SceneRenderer>> make(int samples = 4);
  ~SceneRenderer();
  SceneRenderer(const SceneRenderer&) = delete;
  SceneRenderer& operator=(const SceneRenderer&) = delete;

  /// Builds the meshes; takes a few ms, for a body 0.1 to 0.3 s.
  void setScene(std::shared_ptr<const SceneView> scene);
  [[nodiscard]] const SceneView* scene() const;

  /// Draws at this size if anything changed since the last call. Returns whether it drew.
  bool draw(const SceneFrame& frame, int width_px, int height_px);
  /// Texture for ImGui::Image, upside down (uv from 0,1 to 1,0). Valid until the next `draw`.
  [[nodiscard]] ImTextureID texture() const;
  /// Copies the last drawing to `corner_px` pixel by pixel, which is cheaper than ImGui::Image. Call once per
  /// frame; the renderer must live until the frame has ended.
  void show(ImDrawList& list, ImVec2 corner_px);
  /// Where the names of the structures in a body's cut belong, in the last drawing.
  [[nodiscard]] const std::vector<BodySection::Name>& cutNames() const;
  /// Returns the last drawing, rows from top to bottom, for tests and reports.
  [[nodiscard]] RgbaImage picture() const;
  /// Returns the duration of the last drawing in s: with `wait_for_pixels` until the pixels were complete
  /// (for benchmarks, because it delays the frame), otherwise until the driver had the commands.
  [[nodiscard]] double lastDraw_s() const;
  bool wait_for_pixels = false;

 private:
  explicit SceneRenderer(std::unique_ptr<SceneParts> parts);
  std::unique_ptr<SceneParts> parts_;
};

/// The user's actions on the widget.
struct SceneWidgetResult {
  bool camera_moved = false;  ///< the mouse changed `frame.camera`: drag (left: turn, right: shift), wheel or
                              ///< double click (initial view)
  bool hovered = false;
  ImVec2 corner_px, size_px;  ///< the picture's position on the surface
};
struct SceneWidgetOptions {
  bool mouse_moves_camera = true;
  bool labels = true;  ///< names of layers, target, hazards (if the aids allow)
  bool legend = true;  ///< of the planned line, and of the force arrows with numbers
  /// In a body: structures (layers of the scene) that are named beside target and hazards, first of all;
  /// null: all bones, tendons, nerves and vessels.
  const std::vector<int>* met = nullptr;
};
/// Draws the scene into the current window, `size_px` large (0: the rest), with labels and legend over it.
/// The mouse changes `frame.camera`.
SceneWidgetResult sceneWidget(const char* id, SceneRenderer& renderer, SceneFrame& frame, ImVec2 size_px,
                              const SceneWidgetOptions& options = {});

}  // namespace needlelab
