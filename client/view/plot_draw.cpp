#include "client/view/plot_draw.h"

#include <algorithm>
#include <cmath>

#include "client/view/theme.h"

namespace needlelab {
namespace {

constexpr float kLevel_px = 0.2F;  // less than that nobody sees

ImVec2 sizeOfText(std::string_view text) {
  return ImGui::CalcTextSize(text.data(), text.data() + text.size());
}

void strokeRun(ImDrawList& list, const std::vector<ImVec2>& run, ImU32 colour, float width_px, bool dashed) {
  if (run.size() == 1) {
    list.AddCircleFilled(run.front(), width_px, colour, 6);
    return;
  }
  if (!dashed) {
    list.AddPolyline(run.data(), static_cast<int>(run.size()), colour, 0, width_px);
    return;
  }
  // dashes of equal length along the line
  constexpr float kOn_px = 6, kPeriod_px = 10;
  float along_px = 0;
  for (std::size_t i = 1; i < run.size(); ++i) {
    const ImVec2 a = run[i - 1], b = run[i];
    const float length_px = std::hypot(b.x - a.x, b.y - a.y);
    for (float at_px = 0; at_px < length_px;) {
      const float phase_px = std::fmod(along_px + at_px, kPeriod_px);
      const bool on = phase_px < kOn_px;
      const float step_px =
          std::min(length_px - at_px, std::max(0.01F, (on ? kOn_px : kPeriod_px) - phase_px));
      const auto at = [&](float s) {
        return ImVec2{a.x + (b.x - a.x) * s / length_px, a.y + (b.y - a.y) * s / length_px};
      };
      if (on) list.AddLine(at(at_px), at(at_px + step_px), colour, width_px);
      at_px += step_px;
    }
    along_px += length_px;
  }
}

}  // namespace

PlotField plotFieldAt(ImVec2 at, ImVec2 size_px, bool show_x_axis) {
  const float text_px = fontOf(Letters::kSmall)->FontSize;
  return {{at.x + text_px * 3.1F, at.y + text_px * 1.35F},
          {at.x + size_px.x - 6, at.y + size_px.y - (show_x_axis ? text_px * 1.5F : 5)}};
}

void drawPlotText(ImDrawList& list, ImVec2 at, ImU32 colour, std::string_view text) {
  list.AddText(at, colour, text.data(), text.data() + text.size());
}

void drawColumns(ImDrawList& list, const PlotFrame& frame, const PlotSeries& series,
                 std::span<const PixelColumn> columns) {
  const ImU32 colour = packed(series.colour);
  // whole pixels: ImGui then draws a line with half of the triangles
  const float width_px = std::max(1.0F, std::round(space() * 0.21F));
  const float per_column_px =
      (frame.high_px.x - frame.low_px.x) / static_cast<float>(std::max<std::size_t>(columns.size(), 1));
  const float tall_px = 2 * width_px;
  std::vector<ImVec2> run;
  int empty_run = 0;
  const auto flush = [&] {
    if (series.filled && run.size() > 1) {
      const float zero_px = std::clamp(frame.yAt(0), frame.low_px.y, frame.high_px.y);
      const ImU32 faint = packed(series.colour, 0.16F);
      for (std::size_t i = 1; i < run.size(); ++i)
        list.AddRectFilled({run[i - 1].x, std::min(run[i].y, zero_px)},
                           {run[i].x, std::max(run[i].y, zero_px)}, faint);
    }
    if (!run.empty()) strokeRun(list, run, colour, width_px, series.dashed);
    run.clear();
  };
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const PixelColumn& column = columns[i];
    if (column.empty()) {
      // a column or two without a sample are only a slow stream; more of them are a hole, or no value there
      if (++empty_run > 3 + static_cast<int>(columns.size()) / 60) flush();
      continue;
    }
    empty_run = 0;
    const float x_px = frame.low_px.x + (static_cast<float>(i) + 0.5F) * per_column_px;
    const float top_px = frame.yAt(static_cast<double>(column.max)),
                low_px = frame.yAt(static_cast<double>(column.min));
    if (std::fabs(top_px - low_px) > tall_px)
      list.AddRectFilled({x_px - 0.5F * per_column_px, std::min(top_px, low_px)},
                         {x_px + 0.5F * per_column_px, std::max(top_px, low_px)},
                         packed(series.colour, 0.65F));
    const float y_px = frame.yAt(static_cast<double>(column.last));
    // a level stretch needs its ends only
    if (run.size() > 1 && std::fabs(run[run.size() - 1].y - y_px) < kLevel_px &&
        std::fabs(run[run.size() - 2].y - y_px) < kLevel_px)
      run.back().x = x_px;
    else
      run.push_back({x_px, y_px});
  }
  flush();
}

void drawBands(ImDrawList& list, const PlotFrame& frame, std::span<const PlotBand> bands) {
  WithFont font(Letters::kSmall);
  float taken_to_px = -1;
  for (const PlotBand& band : bands) {
    const float a_px = frame.yAt(std::clamp(band.low, frame.y.low, frame.y.high));
    const float b_px = frame.yAt(std::clamp(band.high, frame.y.low, frame.y.high));
    const float top_px = std::min(a_px, b_px), low_px = std::max(a_px, b_px);
    if (low_px - top_px < 0.5F) continue;
    list.AddRectFilled({frame.low_px.x, top_px}, {frame.high_px.x, low_px}, packed(band.colour, 0.17F));
    list.AddLine({frame.low_px.x, top_px}, {frame.high_px.x, top_px}, packed(band.colour, 0.45F));
    // a stripe of the full colour at the edge ties the name to the tissue's colour elsewhere
    list.AddRectFilled({frame.low_px.x, top_px}, {frame.low_px.x + 4, low_px}, packed(band.colour, 0.9F));
    const float text_px = ImGui::GetFontSize();
    const float at_px = std::max((top_px + low_px - text_px) * 0.5F, taken_to_px);
    if (band.name.empty() || at_px + text_px > low_px + text_px * 0.35F) continue;
    drawPlotText(list, {frame.low_px.x + 9, at_px}, packed(mixed(band.colour, kWhite, 0.45F), 0.95F),
                 band.name);
    taken_to_px = at_px + text_px * 0.92F;
  }
}

void drawMarks(ImDrawList& list, const PlotFrame& frame, std::span<const PlotMark> marks,
               const float* hover_x_px) {
  WithFont font(Letters::kSmall);
  const PlotMark* nearest = nullptr;
  float nearest_px = 7, sign_free_px = -1e9F;
  for (const PlotMark& mark : marks) {
    if (mark.x < frame.from || mark.x > frame.to) continue;
    const float x_px = frame.xAt(mark.x);
    list.AddLine({x_px, frame.low_px.y}, {x_px, frame.high_px.y}, packed(mark.colour, 0.38F));
    const float width_px = sizeOfText(mark.sign).x;
    // signs that would cover one another are left out; their lines stay
    if (!mark.sign.empty() && x_px - width_px * 0.5F > sign_free_px) {
      drawPlotText(list, {x_px - width_px * 0.5F, frame.low_px.y + 1}, packed(mark.colour), mark.sign);
      sign_free_px = x_px + width_px * 0.5F;
    }
    if (hover_x_px != nullptr && !mark.text.empty() && std::fabs(*hover_x_px - x_px) < nearest_px) {
      nearest = &mark;
      nearest_px = std::fabs(*hover_x_px - x_px);
    }
  }
  if (nearest == nullptr) return;
  const ImVec2 size = sizeOfText(nearest->text);
  const float x_px = std::clamp(frame.xAt(nearest->x) - size.x * 0.5F, frame.low_px.x,
                                std::max(frame.low_px.x, frame.high_px.x - size.x));
  const ImVec2 at{x_px, frame.low_px.y + ImGui::GetFontSize() * 1.15F};
  list.AddRectFilled({at.x - 4, at.y - 2}, {at.x + size.x + 4, at.y + size.y + 2}, packed(kBlack, 0.8F), 4);
  drawPlotText(list, at, packed(mixed(nearest->colour, kWhite, 0.4F)), nearest->text);
}

}  // namespace needlelab
