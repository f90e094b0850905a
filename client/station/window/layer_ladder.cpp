#include "client/station/window/layer_ladder.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "client/view/model/axis_ticks.h"
#include "client/view/model/palette.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kOutside = 0.12;  // share of the ladder above the skin

struct LadderScale {
  ImVec2 corner, size;
  double depth_m;
  [[nodiscard]] float y(double depth) const {
    const double share = kOutside + (1 - kOutside) * depth / depth_m;
    return corner.y + size.y * static_cast<float>(std::clamp(share, 0.0, 1.0));
  }
};

void drawText(ImDrawList* draw, ImVec2 at, Rgb colour, const std::string& text) {
  draw->AddText(at, packed(colour), text.c_str());
}

// dark letters on light tissue, light ones on dark
Rgb lettersOn(Rgb background) {
  return relativeLuminance(background) > 0.3 ? kBlack : kWhite;
}

}  // namespace

double ladderDepth_m(const SceneView& scene) {
  double deepest = 0;
  for (const TargetView& target : scene.targets)
    deepest = std::max(deepest, depthAt(scene, target.center_W_m) + target.radius_m);
  if (deepest > 0) return 1.2 * deepest;
  const double layers = scene.layers.empty() ? 0.05 : scene.layers.back().bottom_m;
  return std::max(1e-3, std::min(layers, scene.needle.length_m > 0 ? scene.needle.length_m : layers));
}

void layerLadder(const SceneView& scene, const Moment& now, const AidSet& aids, ImVec2 size_px) {
  const bool names = aids.has(pb::Exercise::LAYER), depth = aids.has(pb::Exercise::DEPTH),
             anatomy = aids.has(pb::Exercise::ANATOMY);
  if (!names && !depth) return;
  const WithFont small(Letters::kSmall);
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  if (size_px.x <= 0) size_px.x = ImGui::GetContentRegionAvail().x;
  ImGui::Dummy(size_px);
  ImDrawList* const draw = ImGui::GetWindowDrawList();
  const float scale_width = depth ? 4.2F * space() : 0, mark_width = 2.2F * space();
  const LadderScale ladder{{corner.x + scale_width, corner.y},
                           {size_px.x - scale_width - mark_width, size_px.y},
                           ladderDepth_m(scene)};
  const float left = ladder.corner.x, right = left + ladder.size.x, bottom = corner.y + size_px.y;
  const float line = ImGui::GetTextLineHeight();

  draw->PushClipRect(corner, {corner.x + size_px.x, bottom}, true);
  draw->AddRectFilled({left, corner.y}, {right, ladder.y(0)}, packed(kPanelGrey));
  for (std::size_t i = 0; i < scene.layers.size(); ++i) {
    const LayerView& layer = scene.layers[i];
    if (layer.top_m >= ladder.depth_m) break;
    const float top = ladder.y(layer.top_m),
                end = i + 1 == scene.layers.size() ? bottom : ladder.y(layer.bottom_m);
    const Rgb colour = names ? tissueColour(layer.tissue) : kLineGrey;
    const bool here = names && now.layer == static_cast<int>(i);
    draw->AddRectFilled({left, top}, {right, end}, packed(colour, here || !names ? 1.0F : 0.65F));
    draw->AddLine({left, top}, {right, top}, packed(kBlack, 0.6F));
    if (here) draw->AddRect({left, top}, {right, end}, packed(kWhite), 0, 0, 2.5F);
    // names that do not fit stand out of the way of others: they are left to the highlight
    if (names && (end - top >= 0.8F * line || here))
      drawText(draw, {left + 0.6F * space(), 0.5F * (top + end - line)}, lettersOn(colour), layer.name);
  }
  if (anatomy)
    for (const TargetView& target : scene.targets) {
      const double at = depthAt(scene, target.center_W_m);
      const float y = ladder.y(at), reach = std::max(3.0F, ladder.y(at + target.radius_m) - y);
      draw->AddRectFilled({right - 0.9F * space(), y - reach}, {right, y + reach}, packed(kTargetColour));
      draw->AddRect({right - 0.9F * space(), y - reach}, {right, y + reach}, packed(kWhite));
    }
  if (depth) {
    const AxisTicks ticks = axisTicks(0, 1e3 * ladder.depth_m, 5, false);
    for (const double mm : ticks.at) {
      const float y = ladder.y(1e-3 * mm);
      draw->AddLine({left - 0.5F * space(), y}, {left, y}, packed(kDimText));
      drawText(draw, {corner.x, std::min(y - 0.5F * line, bottom - line)}, kDimText,
               tickText(mm, ticks.decimals));
    }
    // the tip, also while it is outside
    const float y = ladder.y(std::max(now.depth_m, -kOutside / (1 - kOutside) * ladder.depth_m));
    draw->AddLine({left, y}, {right, y}, packed(kWhite), 2);
    draw->AddTriangleFilled({right + 0.2F * space(), y}, {right + 1.6F * space(), y - 0.8F * space()},
                            {right + 1.6F * space(), y + 0.8F * space()}, packed(kWhite));
  }
  draw->AddRect({left, corner.y}, {right, bottom}, packed(kLineGrey));
  draw->PopClipRect();
}

}  // namespace needlelab
