/// Draws plots (client/view/model/plot.h) as SVG within HTML, for reports.
#pragma once

#include <string>
#include <string_view>

#include "client/view/model/plot.h"

namespace needlelab {

/// Escapes text from other people for use between tags and in quoted attributes: & < > " ' become
/// entities; control characters and bytes that are not UTF-8 become '?'.
std::string htmlText(std::string_view text);

/// In points.
struct SvgSize {
  double width = 720, height = 200;
};
/// Returns one <svg> with all names escaped. Draws long series by the minimum and maximum at each point.
/// Converts the dark windows' colours to ink for white paper; shows time in s.
std::string svgPlot(const Plot& plot, SvgSize size = {});

/// A value within a reference's range: a bar with least, greatest, p10 … p90, mean and the value.
struct SvgStanding {
  double least = 0, greatest = 0, mean = 0, value = 0;
  double p10 = 0, p90 = 0;  ///< equal: unknown
};
std::string svgStanding(const SvgStanding& standing);

}  // namespace needlelab
