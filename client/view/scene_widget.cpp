#include <algorithm>

#include "client/view/scene_labels.h"
#include "client/view/scene_renderer.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

bool moveCamera(OrbitCamera& camera, const SceneView& scene, ImVec2 size_px) {
  const ImGuiIO& io = ImGui::GetIO();
  const OrbitCamera before = camera;
  const auto height_px = static_cast<double>(size_px.y);
  const auto dx = static_cast<double>(io.MouseDelta.x), dy = static_cast<double>(io.MouseDelta.y);
  if (ImGui::IsItemActive()) {
    if (ImGui::IsMouseDown(0) && !io.KeyShift)
      camera.orbit(dx, dy, height_px);
    else if (ImGui::IsMouseDown(0) || ImGui::IsMouseDown(1) || ImGui::IsMouseDown(2))
      camera.pan(dx, dy, height_px);
  }
  if (ImGui::IsItemHovered()) {
    if (io.MouseWheel != 0) camera.zoom(static_cast<double>(io.MouseWheel));
    if (ImGui::IsMouseDoubleClicked(0)) camera = firstLook(scene);
  }
  return !(camera == before);
}

}  // namespace

SceneWidgetResult sceneWidget(const char* id, SceneRenderer& renderer, SceneFrame& frame, ImVec2 size_px,
                              const SceneWidgetOptions& options) {
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  if (size_px.x <= 0) size_px.x = rest.x;
  if (size_px.y <= 0) size_px.y = rest.y;
  SceneWidgetResult result;
  result.corner_px = ImGui::GetCursorScreenPos();
  result.size_px = size_px = {std::max(size_px.x, 16.0F), std::max(size_px.y, 16.0F)};
  const SceneView* scene = renderer.scene();
  if (scene == nullptr) {
    ImGui::Dummy(size_px);
    return result;
  }
  ImGui::InvisibleButton(id, size_px,
                         ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                             ImGuiButtonFlags_MouseButtonMiddle);
  result.hovered = ImGui::IsItemHovered();
  if (options.mouse_moves_camera) result.camera_moved = moveCamera(frame.camera, *scene, size_px);
  renderer.draw(frame, static_cast<int>(size_px.x), static_cast<int>(size_px.y));

  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 end{result.corner_px.x + size_px.x, result.corner_px.y + size_px.y};
  ImGui::PushClipRect(result.corner_px, end, true);
  renderer.show(list, result.corner_px);
  const PictureFrame picture{result.corner_px, size_px, &frame.camera};
  drawTrails(list, picture, frame);
  drawGuideLines(list, picture, *scene, frame);
  const float legend_px = options.legend ? drawForceLegend(list, picture, frame) : 0;
  if (options.labels) drawNames(list, picture, *scene, frame, legend_px);
  if (options.labels) drawScaleBar(list, picture);
  if (frame.show_needle && frame.moment.approximate) {
    WithFont font(Letters::kSmall);
    constexpr const char* kWords = "≈ samples are missing: entry and line may be off until the needle is out";
    const float width_px = ImGui::CalcTextSize(kWords).x;
    const ImVec2 at{result.corner_px.x + (size_px.x - width_px) * 0.5F, result.corner_px.y + space() * 0.6F};
    list.AddRectFilled({at.x - 6, at.y - 2}, {at.x + width_px + 6, at.y + ImGui::GetFontSize() + 4},
                       packed(kBlack, 0.6F), 4);
    list.AddText(at, packed(kOrange), kWords);
  }
  ImGui::PopClipRect();
  return result;
}

}  // namespace needlelab
