/// Line plots as SVG within HTML: for reports.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "client/view/model/palette.h"
#include "client/view/model/pixel_columns.h"

namespace needlelab {

struct SvgSeries {
  std::string name;
  Rgb colour;
  ColumnSource columns;  ///< in the plot's units
  bool dashed = false;
};
struct SvgBand {
  double low = 0, high = 0;
  Rgb colour;
  std::string name;
};
struct SvgMark {
  double x = 0;
  std::string sign, text;  ///< one glyph at the top, and what a pointer over it shows
};
struct SvgPlot {
  std::string title, unit, x_title;
  double from = 0, to = 1;  ///< x
  bool downward = false;    ///< y grows downward (depth)
  std::vector<SvgSeries> series;
  std::vector<SvgBand> bands;
  std::vector<SvgMark> marks;
};

/// One <svg> of 720 × 200 points, all names escaped. Long series are drawn by least and greatest of each
/// point.
std::string svgPlot(const SvgPlot& plot);

/// A few values by attempt, from 1, with the reference's band where there is one (high > low).
struct SvgProgress {
  std::string title, unit;
  std::vector<double> attempts, values;  ///< ascending, as many of both
  double band_low = 0, band_high = 0;
};
std::string svgProgress(const SvgProgress& progress);

/// Where a value stands in a reference's range: a bar with least, greatest, p10 … p90, mean and the value.
struct SvgStanding {
  double least = 0, greatest = 0, mean = 0, value = 0;
  double p10 = 0, p90 = 0;  ///< equal: not known
};
std::string svgStanding(const SvgStanding& standing);

}  // namespace needlelab
