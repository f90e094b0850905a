/// Plots in a window, drawn with ImDrawList from their description (client/view/model/plot.h).
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <imgui/imgui.h>

#include "client/view/model/plot.h"

namespace needlelab {

/// The mouse's actions on a plot.
struct PlotResult {
  bool hovered = false;
  double hover_x = 0;               ///< the x under the mouse
  std::optional<double> clicked_x;  ///< pressed or dragged with the left button: seek to this x
  double scrolled = 0;              ///< wheel steps: zoom about hover_x
  double dragged = 0;               ///< x distance of a right-button drag: shift the range
};
/// `size_px`: 0 is the rest of the window. Costs about 0.1 ms with 5 series of 600 columns.
PlotResult linePlot(const char* id, const Plot& plot, ImVec2 size_px, bool show_x_axis = true);

/// Several plots stacked, with one x axis.
PlotResult plotStack(const char* id, std::span<const Plot> plots, ImVec2 size_px);

/// Corners of a plot's field; numbers and title lie around it.
struct PlotField {
  ImVec2 low_px, high_px;
  [[nodiscard]] bool tooSmall() const { return high_px.x - low_px.x < 20 || high_px.y - low_px.y < 12; }
};
PlotField plotFieldAt(ImVec2 at, ImVec2 size_px, bool show_x_axis);
/// Left edge of an x-axis label: centred at `x_px`, but within the field or slightly beyond; left-aligned if
/// the label is wider than that.
float labelLeftAt(const PlotField& field, float x_px, float width_px);

/// Draws a plot's heading at the left, then its series with their colours (plot_legend.cpp). Shows the values
/// at `read_x`, if given, when all fit, otherwise only the first series' value. Entries that still do not fit
/// are counted: "+2". `columns`: by series; `step`: of the y axis.
void drawPlotLegend(ImDrawList& list, ImVec2 at, float right_px, const Plot& plot,
                    std::span<const std::vector<PixelColumn>> columns, std::optional<double> read_x,
                    double step);

/// Draws a few hundred points as a small line without axes, ending in a dot, for tiles and tables.
void sparkline(std::span<const float> values, float low, float high, Rgb colour, ImVec2 size_px);

}  // namespace needlelab
