/// One log-log diagram of the accuracy pictures, from its points to gnuplot's words.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace needlelab {

struct PanelPoint {
  double x = 0, y = 0;           ///< not negative; 0 stands at the axis and says so
  std::optional<double> spread;  ///< of y
  std::string label;             ///< empty = none
  std::size_t series = 0;        ///< its colour and shape
  bool fits = true;              ///< filled, else hollow
  bool front = false;            ///< on the Pareto front of its series
};

struct Panel {
  std::string title;        ///< the finding
  std::string under_title;  ///< what is compared
  std::string x_title, y_title;
  std::string x_unit, y_unit;       ///< of base units, written with SI prefixes at the ticks: "s", "N", "B/s"
  std::vector<std::string> series;  ///< names; shown when there is more than one
  std::vector<PanelPoint> points;
  std::optional<double> level;  ///< a horizontal line, e.g. what a hand notices
  std::string level_name;
};

/// Where a panel stands in a picture, in pixels from the lower left; axes' titles and the panel's own title
/// are inside.
struct PanelPlace {
  double left = 0, bottom = 0, width = 0, height = 0;
  double picture_width = 0, picture_height = 0;
};

/// gnuplot commands within `set multiplot`. `number` makes the names of data blocks unique. A panel without
/// points gives nothing.
std::string panelScript(const Panel& panel, const PanelPlace& place, std::size_t number);

/// "20 ns", "1.5 mN", "300 kB/s": three figures at most with an SI prefix. 0 is "0".
std::string siText(double value, const std::string& unit);

}  // namespace needlelab
