#include "client/station/window/depth_plot.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "client/view/model/axis_ticks.h"
#include "client/view/model/palette.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

constexpr double kOutside_m = 0.005;

struct DepthAxes {
  ImVec2 corner, size;
  DepthPlotRange range;
  [[nodiscard]] float x(double depth_m) const {
    return corner.x + size.x * static_cast<float>((depth_m - range.from_m) / (range.to_m - range.from_m));
  }
  [[nodiscard]] float y(double force_N) const {
    return corner.y + size.y * static_cast<float>(1 - force_N / range.force_N);
  }
};

void drawBands(ImDrawList* draw, const DepthAxes& axes, const SceneView& scene) {
  const float bottom = axes.corner.y + axes.size.y, end = axes.corner.x + axes.size.x;
  int row = 0;
  for (std::size_t i = 0; i < scene.layers.size(); ++i) {
    const LayerView& layer = scene.layers[i];
    if (layer.top_m >= axes.range.to_m) break;
    const float left = axes.x(layer.top_m);
    const float right = i + 1 == scene.layers.size() ? end : std::min(end, axes.x(layer.bottom_m));
    draw->AddRectFilled({left, axes.corner.y}, {right, bottom}, packed(tissueColour(layer.tissue), 0.35F));
    draw->AddLine({left, axes.corner.y}, {left, bottom}, packed(kLineGrey));
    // names of thin layers go to other rows
    const float width = ImGui::CalcTextSize(layer.name.c_str()).x;
    row = right - left > width + 4 ? 0 : (row + 1) % 3;
    draw->AddText({std::min(left + 3, end - width),
                   axes.corner.y + 2 + static_cast<float>(row) * ImGui::GetTextLineHeight()},
                  packed(kText), layer.name.c_str());
  }
  for (const TargetView& target : scene.targets) {
    const double at = depthAt(scene, target.center_W_m);
    const float left = axes.x(at - target.radius_m), right = axes.x(at + target.radius_m);
    if (left > end) continue;
    draw->AddRectFilled({left, bottom - 6}, {std::min(right, end), bottom}, packed(kTargetColour));
    draw->AddRect({left, axes.corner.y}, {std::min(right, end), bottom}, packed(kTargetColour, 0.8F));
  }
}

void drawAxes(ImDrawList* draw, const DepthAxes& axes) {
  const float bottom = axes.corner.y + axes.size.y, line = ImGui::GetTextLineHeight();
  const AxisTicks depths = axisTicks(1e3 * axes.range.from_m, 1e3 * axes.range.to_m, 7, false);
  for (const double mm : depths.at) {
    const std::string text = tickText(mm, depths.decimals);
    const float x = axes.x(1e-3 * mm);
    draw->AddLine({x, bottom}, {x, bottom + 4}, packed(kDimText));
    draw->AddText({x - 0.5F * ImGui::CalcTextSize(text.c_str()).x, bottom + 5}, packed(kDimText),
                  text.c_str());
  }
  const AxisTicks forces = axisTicks(0, axes.range.force_N, 5, false);
  for (const double force : forces.at) {
    const std::string text = tickText(force, forces.decimals);
    const float y = axes.y(force);
    draw->AddLine({axes.corner.x, y}, {axes.corner.x + axes.size.x, y}, packed(kLineGrey, 0.6F));
    draw->AddText({axes.corner.x - ImGui::CalcTextSize(text.c_str()).x - 5, y - 0.5F * line},
                  packed(kDimText), text.c_str());
  }
}

// one line per way, so that each can have its colour
void drawGesture(ImDrawList* draw, const DepthAxes& axes, const GestureCurve& curve) {
  std::vector<ImVec2> points;
  bool inward = true;
  const auto flush = [&] {
    if (points.size() > 1)
      draw->AddPolyline(points.data(), static_cast<int>(points.size()), packed(inward ? kSkyBlue : kOrange),
                        0, 2);
    if (!points.empty()) points.erase(points.begin(), points.end() - 1);
  };
  double turn_m = curve.empty() ? 0 : static_cast<double>(curve.front().depth_m);
  constexpr double kTurn_m = 1e-3;  // less is trembling
  for (const CurvePoint& point : curve) {
    const double depth = static_cast<double>(point.depth_m);
    turn_m = inward ? std::max(turn_m, depth) : std::min(turn_m, depth);
    if (std::abs(depth - turn_m) > kTurn_m) {
      flush();
      inward = !inward;
      turn_m = depth;
    }
    points.push_back({axes.x(depth), axes.y(static_cast<double>(point.force_N))});
  }
  flush();
}

}  // namespace

DepthPlotRange depthPlotRange(const GestureCurve& curve, const SceneView& scene) {
  DepthPlotRange range;
  double deepest = 0, force = 0;
  for (const CurvePoint& point : curve) {
    deepest = std::max(deepest, static_cast<double>(point.depth_m));
    force = std::max(force, static_cast<double>(point.force_N));
  }
  for (const TargetView& target : scene.targets)
    deepest = std::max(deepest, depthAt(scene, target.center_W_m) + target.radius_m);
  range.from_m = -kOutside_m;
  range.to_m = std::max(1.08 * deepest, kOutside_m);
  range.force_N = std::max(1.1 * force, 0.5);
  return range;
}

void depthPlot(const GestureCurve& curve, const SceneView& scene, ImVec2 size_px) {
  const WithFont small(Letters::kSmall);
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  if (size_px.x <= 0) size_px.x = ImGui::GetContentRegionAvail().x;
  ImGui::Dummy(size_px);
  ImDrawList* const draw = ImGui::GetWindowDrawList();
  const float line = ImGui::GetTextLineHeight(), left = 4.5F * space();
  draw->AddText(corner, packed(kText), "force over depth, N over mm");
  // the legend, at the right of the title
  const float legend = ImGui::CalcTextSize("— in   — out").x;
  const float x = corner.x + size_px.x - legend - space();
  draw->AddText({x, corner.y}, packed(kSkyBlue), "— in");
  draw->AddText({x + ImGui::CalcTextSize("— in   ").x, corner.y}, packed(kOrange), "— out");
  const DepthAxes axes{{corner.x + left, corner.y + 1.4F * line},
                       {size_px.x - left - space(), size_px.y - 2.9F * line},
                       depthPlotRange(curve, scene)};
  if (axes.size.y < 20) return;
  const ImVec2 end{axes.corner.x + axes.size.x, axes.corner.y + axes.size.y};
  draw->PushClipRect(axes.corner, end, true);
  drawBands(draw, axes, scene);
  draw->PopClipRect();
  drawAxes(draw, axes);
  draw->PushClipRect(axes.corner, end, true);
  drawGesture(draw, axes, curve);
  draw->PopClipRect();
  draw->AddRect(axes.corner, end, packed(kLineGrey));
}

}  // namespace needlelab
