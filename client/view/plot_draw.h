/// The strokes of a plot. Private to this folder.
#pragma once

#include <span>
#include <string>

#include <imgui/imgui.h>

#include "client/view/model/axis_ticks.h"
#include "client/view/plots.h"

namespace needlelab {

/// Where a plot's numbers stand on the surface.
struct PlotFrame {
  ImVec2 low_px, high_px;  ///< corners of the field: left upper, right lower
  double from = 0, to = 1;
  AxisTicks y;
  bool downward = false;

  [[nodiscard]] float xAt(double x) const {
    return low_px.x + static_cast<float>((x - from) / (to - from)) * (high_px.x - low_px.x);
  }
  [[nodiscard]] float yAt(double value) const {
    const auto share = static_cast<float>((value - y.low) / (y.high - y.low));
    return downward ? low_px.y + share * (high_px.y - low_px.y) : high_px.y - share * (high_px.y - low_px.y);
  }
};

/// Where the field of a plot at `at` stands: left upper and right lower corner, numbers and title around it.
struct PlotField {
  ImVec2 low_px, high_px;
  [[nodiscard]] bool tooSmall() const { return high_px.x - low_px.x < 20 || high_px.y - low_px.y < 12; }
};
PlotField plotFieldAt(ImVec2 at, ImVec2 size_px, bool show_x_axis);

void drawPlotText(ImDrawList& list, ImVec2 at, ImU32 colour, std::string_view text);
/// A line through the columns' last values, and a vertical stroke where a column's range is taller than the
/// line.
void drawColumns(ImDrawList& list, const PlotFrame& frame, const PlotSeries& series,
                 std::span<const PixelColumn> columns);
void drawBands(ImDrawList& list, const PlotFrame& frame, std::span<const PlotBand> bands);
/// The marks' lines and signs; the words of the one that is nearest to the mouse (`hover_x_px`, if within
/// reach).
void drawMarks(ImDrawList& list, const PlotFrame& frame, std::span<const PlotMark> marks,
               const float* hover_x_px);

}  // namespace needlelab
