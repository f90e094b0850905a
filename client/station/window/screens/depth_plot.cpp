#include <imgui/imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "client/station/window/screens/end_screen.h"
#include "client/view/model/palette.h"
#include "client/view/model/plot.h"
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

void drawBands(ImDrawList* draw, const DepthAxes& axes, const TissuesOnLine& way, const SceneView& scene) {
  const float bottom = axes.corner.y + axes.size.y, end = axes.corner.x + axes.size.x;
  std::array<float, 4> row_end{};  // where the names end so far; a name without room is omitted
  for (const TissuesOnLine::Tissue& tissue : way.tissues) {
    const LayerView& layer = scene.layers[static_cast<std::size_t>(tissue.layer)];
    if (tissue.top_m >= axes.range.to_m) break;
    const float left = axes.x(tissue.top_m), right = std::min(end, axes.x(tissue.bottom_m));
    draw->AddRectFilled({left, axes.corner.y}, {right, bottom}, packed(layer.colour, 0.35F));
    draw->AddLine({left, axes.corner.y}, {left, bottom}, packed(kLineGrey));
    if (isTarget(scene, tissue.layer)) continue;
    // moves names of thin layers to other rows
    const std::string name = fittedText(layer.name, axes.size.x - 6);
    const float width = ImGui::CalcTextSize(name.c_str()).x, from = std::min(left + 3, end - width);
    const auto row = std::ranges::find_if(row_end, [&](float taken) { return from >= taken; });
    if (row == row_end.end()) continue;
    *row = from + width + 0.5F * space();
    draw->AddText(
        {from, axes.corner.y + 2 + static_cast<float>(row - row_end.begin()) * ImGui::GetTextLineHeight()},
        packed(kText), name.c_str());
  }
  for (const TissuesOnLine::Aim& aim : way.targets) {
    const float left = axes.x(aim.top_m), right = std::max(left + 2, std::min(axes.x(aim.bottom_m), end));
    if (left > end) continue;
    draw->AddRectFilled({left, bottom - 6}, {right, bottom}, packed(kTargetColour));
    draw->AddRect({left, axes.corner.y}, {right, bottom}, packed(kTargetColour, 0.8F));
    if (aim.name.empty()) continue;
    const std::string name = fittedText(aim.name, axes.size.x - 6);
    const float width = ImGui::CalcTextSize(name.c_str()).x;
    const ImVec2 from{std::min(left + 3, end - width - 3), bottom - 8 - ImGui::GetTextLineHeight()};
    draw->AddRectFilled({from.x - 2, from.y}, {from.x + width + 2, bottom - 8}, packed(kBlack, 0.6F));
    draw->AddText(from, packed(kTargetColour), name.c_str());
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

// one line per direction, each with its own colour
void drawGesture(ImDrawList* draw, const DepthAxes& axes, const GestureCurve& curve,
                 const TissuesOnLine& way) {
  std::vector<ImVec2> points;
  bool inward = true, off_way = false;
  const auto flush = [&] {
    if (points.size() > 1)
      draw->AddPolyline(points.data(), static_cast<int>(points.size()),
                        packed(off_way  ? kDimText
                               : inward ? kSkyBlue
                                        : kOrange),
                        0, 2);
    if (!points.empty()) points.erase(points.begin(), points.end() - 1);
  };
  double turn_m = 0;
  constexpr double kTurn_m = 1e-3;  // smaller changes are tremor
  for (const CurvePoint& point : curve) {
    const double depth = static_cast<double>(point.depth_m);
    if (std::isnan(depth)) {
      flush();
      points.clear();
      continue;
    }
    if (points.empty()) turn_m = depth;
    turn_m = inward ? std::max(turn_m, depth) : std::min(turn_m, depth);
    if (std::abs(depth - turn_m) > kTurn_m) {
      flush();
      inward = !inward;
      turn_m = depth;
    }
    if (const bool off = isOffWay(point, way); off != off_way) {
      flush();
      off_way = off;
    }
    points.push_back({axes.x(depth), axes.y(static_cast<double>(point.force_N))});
  }
  flush();
}

}  // namespace

bool isOffWay(const CurvePoint& point, const TissuesOnLine& way) {
  const auto at_m = static_cast<double>(point.depth_m);
  return point.layer >= 0 && std::ranges::none_of(way.tissues, [&](const TissuesOnLine::Tissue& tissue) {
           return tissue.holds(point.layer, at_m);
         });
}

TissuesOnLine wayOf(const LessonOutcome& outcome, const SceneView& scene) {
  const NeedleLine line = outcome.deepest.value_or(lineToTarget(scene));
  return tissuesOnLine(scene, line, lineReach_m(scene, line.entry_W_m, line.u_W));
}

DepthPlotRange depthPlotRange(const GestureCurve& curve, const TissuesOnLine& way) {
  DepthPlotRange range;
  double deepest = 0, force = 0;
  for (const CurvePoint& point : curve) {
    const auto depth = static_cast<double>(point.depth_m);
    if (std::isnan(depth)) continue;
    deepest = std::max(deepest, depth);
    force = std::max(force, static_cast<double>(point.force_N));
  }
  for (const TissuesOnLine::Aim& aim : way.targets)
    if (!aim.name.empty()) deepest = std::max(deepest, aim.bottom_m);
  range.from_m = -kOutside_m;
  range.to_m = std::max(1.08 * deepest, 1e-3 * leastSpanOf(PlotQuantity::kDepth));
  range.force_N = std::max(1.1 * force, leastSpanOf(PlotQuantity::kForce));
  return range;
}

void depthPlot(const GestureCurve& curve, const TissuesOnLine& way, const SceneView& scene, ImVec2 size_px,
               const std::optional<MarkedMoment>& marked) {
  const WithFont small(Letters::kSmall);
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  if (size_px.x <= 0) size_px.x = ImGui::GetContentRegionAvail().x;
  ImGui::Dummy(size_px);
  ImDrawList* const draw = ImGui::GetWindowDrawList();
  const float line = ImGui::GetTextLineHeight(), left = 4.5F * space();
  // the legend, right of the title
  const bool off = std::ranges::any_of(curve, [&](const CurvePoint& point) { return isOffWay(point, way); });
  const char* const words = off ? "— in   — out   — on another line" : "— in   — out";
  const float x = corner.x + size_px.x - ImGui::CalcTextSize(words).x - space();
  draw->AddText(corner, packed(kText),
                fittedText("force over depth, N over mm", x - corner.x - space()).c_str());
  if (off) draw->AddText({x, corner.y}, packed(kDimText), words);
  draw->AddText({x, corner.y}, packed(kSkyBlue), "— in");
  draw->AddText({x + ImGui::CalcTextSize("— in   ").x, corner.y}, packed(kOrange), "— out");
  const DepthAxes axes{{corner.x + left, corner.y + 1.4F * line},
                       {size_px.x - left - space(), size_px.y - 2.9F * line},
                       depthPlotRange(curve, way)};
  if (axes.size.y < 20) return;
  const ImVec2 end{axes.corner.x + axes.size.x, axes.corner.y + axes.size.y};
  draw->PushClipRect(axes.corner, end, true);
  drawBands(draw, axes, way, scene);
  draw->PopClipRect();
  drawAxes(draw, axes);
  draw->PushClipRect(axes.corner, end, true);
  drawGesture(draw, axes, curve, way);
  if (marked) {
    const ImVec2 at{axes.x(marked->insertion_m), axes.y(marked->force_N)};
    draw->AddLine({at.x, axes.corner.y}, {at.x, end.y}, packed(kWhite), 2);
    draw->AddCircleFilled(at, 0.4F * space(), packed(kWhite));
  }
  draw->PopClipRect();
  draw->AddRect(axes.corner, end, packed(kLineGrey));
}

}  // namespace needlelab
