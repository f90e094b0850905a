/// Draws plots (client/view/model/plot.h) as SVG within HTML, for reports.
#pragma once

#include <string>
#include <string_view>

#include "client/view/model/plot.h"
#include "common/scoring/attempts/reference.h"

namespace needlelab {

/// Escapes other people's text for use between tags and in quoted attributes: & < > " ' become entities;
/// control characters and invalid UTF-8 become '?'.
std::string htmlText(std::string_view text);

/// In points.
struct SvgSize {
  double width = 720, height = 200;
};
/// Returns one <svg> with all names escaped. Draws long series by the minimum and maximum at each point.
/// Converts the dark window's colours to ink for white paper; shows time in s.
std::string svgPlot(const Plot& plot, SvgSize size = {});

/// A value compared with the experts: a bar for their range, a diamond for the value.
std::string svgPlace(const PlaceMarks& marks);

}  // namespace needlelab
