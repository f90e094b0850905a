/// Line plots over time (or any other axis): a small widget on ImDrawList.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <imgui/imgui.h>

#include "client/view/model/gesture_trace.h"
#include "client/view/model/palette.h"
#include "client/view/model/pixel_columns.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

struct PlotSeries {
  std::string name;  ///< in the legend and the hover's readout
  Rgb colour = kText;
  ColumnSource columns;  ///< in the plot's units
  bool dashed = false;
  bool filled = false;  ///< down to zero, faintly
};
/// A horizontal band with its name at the left edge, e.g. a layer's depths or a reference's range.
struct PlotBand {
  double low = 0, high = 0;
  Rgb colour;
  std::string name;
};
/// A vertical mark.
struct PlotMark {
  double x = 0;
  Rgb colour = kDimText;
  std::string sign;  ///< one glyph at the top; empty: only the line
  std::string text;  ///< when the mouse is near
};

struct PlotSpec {
  std::string title, unit;  ///< "force", "N"
  double from = 0, to = 1;  ///< x
  bool clock_axis = true;   ///< x is s, shown m:ss; else whole numbers with `x_unit`
  std::string x_unit;
  bool show_x_axis = true;
  std::optional<double> low, high;  ///< y; absent: as the data wants, calmly (round numbers)
  bool downward = false;            ///< y grows downward (depth)
  std::vector<PlotBand> bands;
  std::vector<PlotMark> marks;
  std::optional<double> cursor;  ///< a line at this x with the values there
  bool legend = true;
};

/// What the mouse does there.
struct PlotResult {
  bool hovered = false;
  double hover_x = 0;               ///< the x under the mouse
  std::optional<double> clicked_x;  ///< pressed or dragged with the left button: seek there
  double scrolled = 0;              ///< wheel steps: zoom about hover_x
  double dragged = 0;               ///< x by which the right button dragged: shift the range
};
/// The first series lies on top and comes first in the legend. `size_px`: 0 is the rest of the window. Costs
/// some 0.1 ms with 5 series of 600 columns.
PlotResult linePlot(const char* id, const PlotSpec& spec, std::span<const PlotSeries> series, ImVec2 size_px);

/// Several plots under one another with one x axis.
struct StackedPlot {
  PlotSpec spec;
  std::vector<PlotSeries> series;
  float share = 1;  ///< of the height
};
PlotResult plotStack(const char* id, std::span<StackedPlot> plots, ImVec2 size_px);

/// A few hundred points as a small line without axes, for tiles and tables; `last` as a dot.
void sparkline(std::span<const float> values, float low, float high, Rgb colour, ImVec2 size_px);

/// The usual plots of a gesture, from a trace: what both windows show.
enum class GesturePlot : std::uint8_t {
  kForces,  ///< by effect, and the total
  kDepth,   ///< with the layers as bands, downward, wall as a dashed line
  kSpeed,
  kAlignment,  ///< lateral error
  kAngles,     ///< α and the needle's tilt
  kPlaces,     ///< tip and wall per axis (the paper's Fig. 8 and 9)
  kPlunger,
};
/// Refers to `trace` and `scene`, which must live while the plot is drawn. Marks are the trace's events in
/// the range.
StackedPlot gesturePlot(GesturePlot which, const GestureTrace& trace, const SceneView* scene, double from_s,
                        double to_s);

}  // namespace needlelab
