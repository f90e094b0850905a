/// A plot as plain data: axes, series, bands, marks. Two back ends draw it: the windows (client/view/plots.h)
/// and the report's SVG (client/instructor/model/svg_plot.h).
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/view/model/palette.h"

namespace needlelab {

// --- the values of a series, for each column of pixels

/// Minimum, maximum and last value in one pixel column. Empty columns have min > max.
struct PixelColumn {
  float min = std::numeric_limits<float>::infinity();
  float max = -std::numeric_limits<float>::infinity();
  float last = 0;
  [[nodiscard]] bool empty() const { return min > max; }
  void take(float value) {
    min = value < min ? value : min;
    max = value > max ? value : max;
    last = value;
  }
};

/// Fills `out` with the columns of [from, to), oldest first. A plot calls it in each frame.
using ColumnSource = std::function<void(double from, double to, std::span<PixelColumn> out)>;

/// Columns of points (x, y) with x ascending; values that are not finite are left out. O(log n + points in
/// the range).
void fillColumns(std::span<const double> x, std::span<const double> y, double from, double to,
                 std::span<PixelColumn> out);
/// The same as a source; the two spans must outlive it.
ColumnSource columnsOf(std::span<const double> x, std::span<const double> y);
/// Returns the value at x, in the plot's units; nothing where there is none.
using PlotReader = std::function<std::optional<double>(double x)>;

// --- the quantity of the y axis

/// Sets the least that a y axis spans, so that noise does not look like a movement.
enum class PlotQuantity : std::uint8_t {
  kOther,     ///< by the plot's unit; without one no least span
  kNumber,    ///< counts, smoothness
  kForce,     ///< N
  kTorque,    ///< N·m
  kDepth,     ///< mm below the skin, and places in W
  kDistance,  ///< mm from a line or a point
  kSpeed,     ///< mm/s
  kAngle,     ///< °
  kTime,      ///< s
  kArea,      ///< cm²
  kWork,      ///< J
  kShare,     ///< %
};
/// In the plot's units; 0 for kOther.
double leastSpanOf(PlotQuantity quantity);
/// Returns the quantity of a shown unit ("N", "mm", "°", …); for "mm" kDistance, for "" kNumber.
PlotQuantity quantityOfUnit(std::string_view shown_unit);

// --- the description

/// A series has `columns`, or a few points (x, y).
struct PlotSeries {
  std::string name;  ///< in the legend and the hover's readout
  Rgb colour = kText;
  ColumnSource columns;  ///< in the plot's units
  bool dashed = false;
  bool filled = false;  ///< down to zero, faintly
  /// Points joined by lines, each marked; x ascends. Replaces `columns`, e.g. for values by attempt.
  std::vector<double> x = {}, y = {};
  /// The value that the legend shows at the cursor, from where the picture beside the plot takes it; absent:
  /// the last of the cursor's column.
  PlotReader reader = {};
};
/// A horizontal band with its name, e.g. a layer's depths or the range of a reference.
struct PlotBand {
  double low = 0, high = 0;
  Rgb colour;
  std::string name;
};
/// A limit that the exercise sets, drawn as a dashed line across the plot.
struct PlotLimit {
  double at = 0;
  std::string text;  ///< beside the line: "at most 5 N"
};
/// Values are missing between these two x, which have some: a curve is not joined across it.
struct PlotGap {
  double from = 0, to = 0;
};
/// A vertical mark.
struct PlotMark {
  double x = 0;
  Rgb colour = kDimText;
  std::string sign;  ///< one glyph at the top; empty: only the line
  std::string text;  ///< shown when the mouse is near
};

struct Plot {
  std::string title, unit;  ///< "force", "N"
  PlotQuantity quantity = PlotQuantity::kOther;
  double from = 0, to = 1;  ///< x
  bool clock_axis = true;   ///< x is a time in s; else numbers with `x_unit`
  std::string x_unit;
  std::optional<double> low, high;  ///< y range; absent: the back end fits it to the data
  bool downward = false;            ///< y grows downward (depth)
  std::vector<PlotSeries> series;   ///< the first is on top and first in the legend
  std::vector<PlotBand> bands;
  std::vector<PlotLimit> limits;  ///< always within the axis
  std::vector<PlotMark> marks;
  std::vector<PlotGap> gaps;     ///< by x
  std::optional<double> cursor;  ///< a line at this x, with the values there in the legend
  bool legend = true;
  float share = 1;  ///< share of the height in a stack of plots
};

/// Whether a gap lies between the values of two columns, `left` < `right` of `count` in the plot's range. A
/// gap within one column breaks nothing.
bool isBroken(const Plot& plot, std::size_t left, std::size_t right, std::size_t count);

/// Decimals of a force or a torque at one moment, in every picture and beside every plot: 2 for "N", 3 for
/// "N·m". Nothing for other units, whose decimals the axis sets.
std::optional<int> momentDecimals(std::string_view shown_unit);
/// "3.12 N", "0.046 N·m"
std::string momentText(double value, std::string_view unit);

/// "force, N"
std::string headingOf(const Plot& plot);

// --- axes

struct AxisSpan {
  double low = 0, high = 1;
};
/// Returns the y range for the data (none: an empty plot), without air and round numbers. It contains data
/// and limits, zero when that is near, and spans at least `leastSpanOf`: centred on the data, but not beyond
/// zero when all data lie on one side. A given `low` or `high` of the plot stays where it is.
AxisSpan fittedSpan(const Plot& plot, const std::optional<AxisSpan>& data);

struct AxisTicks {
  double low = 0, high = 1;  ///< the axis, widened to round numbers if wanted
  double step = 0.2;         ///< 1, 2 or 5 times a power of ten
  int decimals = 1;          ///< enough to distinguish the ticks
  std::vector<double> at;    ///< all multiples of step in [low, high]
};
/// About `wanted` ticks, at least 2 unless `least_step` (1 for counts) leaves fewer. Replaces an empty,
/// reversed or non-finite range by a valid one around it.
AxisTicks axisTicks(double low, double high, int wanted, bool widen, double least_step = 0);
/// Formats the value with that many decimals, the minus as U+2212, never "-0".
std::string tickText(double value, int decimals);
/// Minutes and seconds "m:ss", with tenths where `decimals` is 1: for time lines.
std::string clockText(double seconds, int decimals = 0);

}  // namespace needlelab
