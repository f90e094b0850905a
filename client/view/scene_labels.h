/// Words and lines over the picture of a scene. Private to this folder.
#pragma once

#include <imgui/imgui.h>

#include "client/view/scene_renderer.h"

namespace needlelab {

/// Where the picture stands on the surface, and its camera.
struct PictureFrame {
  ImVec2 corner_px, size_px;
  const OrbitCamera* camera = nullptr;
  /// On the surface; empty behind the eye.
  [[nodiscard]] std::optional<ImVec2> at(Vec3 p_W_m) const;
  [[nodiscard]] bool holds(ImVec2 point_px) const;
};

void drawGuideLines(ImDrawList& list, const PictureFrame& picture, const SceneView& scene,
                    const SceneFrame& frame);
void drawTrails(ImDrawList& list, const PictureFrame& picture, const SceneFrame& frame);
/// Layers in a column at the left, target and hazards at the right (above `free_below_px` of the picture's
/// lower edge), each with a line to its place.
void drawNames(ImDrawList& list, const PictureFrame& picture, const SceneView& scene, const SceneFrame& frame,
               float free_below_px);
/// The arrows' colours and numbers, lower right. Returns the height that it took.
float drawForceLegend(ImDrawList& list, const PictureFrame& picture, const SceneFrame& frame);
/// A length of 1, 2 or 5 times a power of ten at the focus, lower left.
void drawScaleBar(ImDrawList& list, const PictureFrame& picture);

}  // namespace needlelab
