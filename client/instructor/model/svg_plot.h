/// Plots as SVG within HTML, from their description (client/view/model/plot.h): for reports.
#pragma once

#include <string>
#include <string_view>

#include "client/view/model/plot.h"

namespace needlelab {

/// Escapes text that somebody else wrote, for use between tags and in quoted attributes: & < > " ' become
/// entities; control characters and bytes that are not UTF-8 become '?'.
std::string htmlText(std::string_view text);

/// In points.
struct SvgSize {
  double width = 720, height = 200;
};
/// One <svg>, all names escaped. Long series are drawn by least and greatest of each point. Colours of the
/// dark windows become ink for white paper; a time is shown in s.
std::string svgPlot(const Plot& plot, SvgSize size = {});

/// Shows where a value stands in a reference's range: a bar with least, greatest, p10 … p90, mean and the
/// value.
struct SvgStanding {
  double least = 0, greatest = 0, mean = 0, value = 0;
  double p10 = 0, p90 = 0;  ///< equal: not known
};
std::string svgStanding(const SvgStanding& standing);

}  // namespace needlelab
