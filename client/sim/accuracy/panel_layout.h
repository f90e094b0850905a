/// Layout of the log-log diagrams in the accuracy pictures, in pixels: no label covers another label or a
/// point. The result is the data file that accuracy.gp reads.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/tools/gnuplot.h"

namespace needlelab {

struct PanelPoint {
  double x = 0, y = 0;                                    ///< not negative; 0 stands at the axis and says so
  std::optional<double> spread;                           ///< of y
  std::optional<std::pair<double, double>> x_range = {};  ///< from the least to the greatest x
  std::string label;                                      ///< empty = none
  std::size_t series = 0;                                 ///< its colour and shape
  bool fits = true;                                       ///< filled, else hollow
  bool front = false;                                     ///< on the Pareto front of its series
};

struct Panel {
  std::string title;        ///< the finding
  std::string under_title;  ///< the comparison
  std::string x_title, y_title;
  std::string x_unit, y_unit;       ///< of base units, written with SI prefixes at the ticks: "s", "N", "B/s"
  std::vector<std::string> series;  ///< names; shown when there is more than one
  std::vector<PanelPoint> points;
  std::optional<double> level;  ///< a horizontal line, e.g. a noticeable force
  std::string level_name;
};

/// A panel's area in a picture, in pixels from the lower left, including the axes' titles and the panel's
/// title.
struct PanelPlace {
  double left = 0, bottom = 0, width = 0, height = 0;
};

/// Adds a panel's frame, tics, texts and points to the picture's data. A panel without points adds nothing.
void addPanel(const Panel& panel, const PanelPlace& place, std::size_t number, PlotBlocks& data);

/// "2 N", "0.0015 N": newtons stay newtons, with so many figures and no power of ten.
std::string newtonText(double force_N, int figures);
/// "20 ns", "0.0015 N", "300 kB/s": three figures at most, with an SI prefix except for newtons. 0 is "0".
std::string siText(double value, const std::string& unit);

/// All in pixels; y grows upward, as gnuplot's does.
struct PixelPoint {
  double x = 0, y = 0;
};
struct PixelBox {
  double left = 0, bottom = 0, right = 0, top = 0;
  [[nodiscard]] bool overlaps(const PixelBox& other) const {
    return left < other.right && other.left < right && bottom < other.top && other.bottom < top;
  }
  [[nodiscard]] bool within(const PixelBox& other) const {
    return left >= other.left && right <= other.right && bottom >= other.bottom && top <= other.top;
  }
};

struct PlacedLabel {
  std::size_t point = 0;    ///< index of the point that it names
  PixelBox box;             ///< of the text
  bool needs_line = false;  ///< so far from its point that a line must join them
};

/// The area for the labels, and the lines in it.
struct LabelSpace {
  PixelBox frame;                      ///< names stay within
  std::vector<PixelBox> lines;         ///< should stay readable: covered only where no other place is free
  double letter_px = 8, line_px = 15;  ///< size of a letter
};

/// Places `labels[i]` near `points[i]` (empty labels are skipped), at the nearest free place: never over
/// another label or a point. A label without a free place is left out.
std::vector<PlacedLabel> placeLabels(const std::vector<PixelPoint>& points,
                                     const std::vector<std::string>& labels, const LabelSpace& space);

}  // namespace needlelab
