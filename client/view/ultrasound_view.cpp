#include "client/view/ultrasound_view.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "client/view/model/palette.h"
#include "client/view/model/plot.h"
#include "client/view/theme.h"
#include "common/base/time/clock.h"

namespace needlelab {

void UltrasoundView::show(const char* id, const SceneView& scene, const Moment& moment, ImVec2 size_px,
                          bool hazard_names) {
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  if (size_px.x <= 0) size_px.x = rest.x;
  if (size_px.y <= 0) size_px.y = rest.y;
  const double now_s = ImGui::GetTime();
  const float text_px = fontOf(Letters::kSmall)->FontSize;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const ImVec2 picture{at.x + text_px * 2.6F, at.y};
  const ImVec2 end{at.x + size_px.x, at.y + size_px.y};
  const float width_px = end.x - picture.x, height_px = end.y - picture.y;
  if (width_px < 24 || height_px < 24) {
    ImGui::Dummy(size_px);
    return;
  }
  if (now_s >= next_s_) {
    // computes fewer pixels than shown; smoothing looks realistic
    settings_.height = std::clamp(static_cast<int>(height_px * 0.75F), 64, 360);
    settings_.width =
        std::clamp(static_cast<int>(static_cast<float>(settings_.height) * width_px / height_px), 48, 640);
    const std::int64_t began_ns = steadyNowNs();
    plane_ = slicePlaneOf(scene, moment, has_plane_ ? &plane_ : nullptr);
    has_plane_ = true;
    drawSlice(scene, plane_, moment, settings_, image_);
    cost_s_ = static_cast<double>(steadyNowNs() - began_ns) * 1e-9;
    mean_cost_s_ = mean_cost_s_ > 0 ? 0.8 * mean_cost_s_ + 0.2 * cost_s_ : cost_s_;
    texture_.upload(image_);
    next_s_ = std::max(next_s_ + 1 / pictures_per_s_, now_s);
  }
  ImDrawList& list = *ImGui::GetWindowDrawList();
  list.AddImageRounded(texture_.id(), picture, end, {0, 0}, {1, 1}, packed(kWhite), 5);

  // depth, in mm
  WithFont font(Letters::kSmall);
  const double depth_mm = sliceDepth_m(scene, settings_) * 1000;
  const AxisTicks ticks =
      axisTicks(0, depth_mm, std::max(2, static_cast<int>(height_px / (text_px * 2.4F))), false);
  for (const double mm : ticks.at) {
    const float y_px = picture.y + static_cast<float>(mm / depth_mm) * height_px;
    list.AddLine({picture.x - 5, y_px}, {picture.x, y_px}, packed(kDimText));
    const std::string text = tickText(mm, ticks.decimals);
    list.AddText({picture.x - 8 - ImGui::CalcTextSize(text.c_str()).x,
                  std::clamp(y_px - text_px * 0.5F, at.y, end.y - text_px)},
                 packed(kDimText), text.c_str());
  }
  if (hazard_names) {
    const double px_per_m = static_cast<double>(height_px) / (depth_mm / 1000);
    const double half_width_m = 0.5 * static_cast<double>(width_px) / px_per_m;
    for (const SliceLabel& label : sliceLabels(scene, plane_, half_width_m, depth_mm / 1000)) {
      const ImVec2 size = ImGui::CalcTextSize(label.text.c_str());
      const float x_px = picture.x + 0.5F * width_px + static_cast<float>(label.right_m * px_per_m);
      const float y_px = picture.y + static_cast<float>(label.down_m * px_per_m);
      const float left_px = std::max(picture.x + 4, std::min(x_px - 0.5F * size.x, end.x - size.x - 4));
      const auto opacity = static_cast<float>(std::max(0.5, label.opacity));  // keeps labels readable
      list.AddRectFilled({left_px - 3, y_px - 0.5F * size.y},
                         {left_px + size.x + 3, y_px + 0.5F * size.y + 2}, packed(kBlack, 0.6F), 4);
      list.AddText({left_px, y_px - 0.5F * size.y},
                   packed(mixed(hazardColour(label.kind), kWhite, 0.5F), opacity), label.text.c_str());
    }
  }
  // the picture shows its computation time
  const std::string cost = fmt::format("{} ms, {:.0f}/s", tickText(mean_cost_s_ * 1000, 1), pictures_per_s_);
  // on a dark background, because the skin below is bright
  const auto word = [&](float x_px, const std::string& text) {
    const ImVec2 size = ImGui::CalcTextSize(text.c_str());
    list.AddRectFilled({x_px - 4, picture.y + 3}, {x_px + size.x + 4, picture.y + size.y + 6},
                       packed(kBlack, 0.72F), 4);
    list.AddText({x_px, picture.y + 4}, packed(kText), text.c_str());
  };
  word(end.x - ImGui::CalcTextSize(cost.c_str()).x - 8, cost);
  word(picture.x + 8, "mm");
  ImGui::PushID(id);
  ImGui::Dummy(size_px);
  ImGui::PopID();
}

}  // namespace needlelab
