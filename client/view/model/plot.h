/// A plot as plain data: axes, series, bands, marks. Two back ends draw it: the windows (client/view/plots.h)
/// and the report's SVG (client/instructor/model/stored/svg_plot.cpp).
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

// --- values of a series per pixel column

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

/// Fills `out` with the columns of [from, to), oldest first. A plot calls it in every frame.
using ColumnSource = std::function<void(double from, double to, std::span<PixelColumn> out)>;

/// Columns of points (x, y) with ascending x; skips values that are not finite. O(log n + points in the
/// range).
void fillColumns(std::span<const double> x, std::span<const double> y, double from, double to,
                 std::span<PixelColumn> out);
/// The same as a source; both spans must outlive it.
ColumnSource columnsOf(std::span<const double> x, std::span<const double> y);
/// Returns the value at x in the plot's units, if any.
using PlotReader = std::function<std::optional<double>(double x)>;

// --- the quantity of the y axis

/// Determines the minimum span of a y axis, so that noise does not look like movement.
enum class PlotQuantity : std::uint8_t {
  kOther,     ///< from the plot's unit; without a unit, no minimum span
  kNumber,    ///< counts, smoothness
  kForce,     ///< N
  kTorque,    ///< N·m
  kDepth,     ///< mm below the skin, and positions in W
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

/// A series has either `columns` or a few points (x, y).
struct PlotSeries {
  std::string name;  ///< for the legend and the readout under the mouse
  Rgb colour = kText;
  ColumnSource columns;  ///< in the plot's units
  bool dashed = false;
  bool filled = false;  ///< faintly, down to zero
  /// Points joined by lines, each with a marker; x ascends. Replaces `columns`, e.g. for values by attempt.
  std::vector<double> x = {}, y = {};
  /// Value for the legend at the cursor, from the same source as the picture beside the plot; if absent, the
  /// last value of the cursor's column.
  PlotReader reader = {};
};
/// A horizontal band with a name, e.g. a layer's depths or a reference range.
struct PlotBand {
  double low = 0, high = 0;
  Rgb colour;
  std::string name;
  double from = -std::numeric_limits<double>::infinity(),
         to = std::numeric_limits<double>::infinity();  ///< x
  double name_to = to;                                  ///< the name has room up to this x
  bool is_target = false;  ///< drawn strongly, with its name at the other end, and at least as a line
};
/// A limit set by the exercise, drawn as a dashed line across the plot.
struct PlotLimit {
  double at = 0;
  std::string text;  ///< beside the line: "at most 5 N"
};
/// No values between these two x, although both have one: curves are interrupted there.
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
  bool clock_axis = true;   ///< x is time in s; otherwise numbers with `x_unit`
  std::string x_unit;
  std::optional<double> low, high;  ///< y range; absent: the back end fits it to the data
  bool downward = false;            ///< y grows downward (depth)
  std::vector<PlotSeries> series;   ///< the first is on top, and first in the legend
  std::vector<PlotBand> bands;
  std::vector<PlotLimit> limits;  ///< always within the axis
  std::vector<PlotMark> marks;
  std::vector<PlotGap> gaps;     ///< by x
  std::optional<double> cursor;  ///< draws a line at this x, and the legend shows the values there
  bool legend = true;
  float share = 1;  ///< relative height in a stack of plots
};

/// Whether a gap lies between the values of columns `left` < `right` of `count` in the plot's range. A gap
/// within one column does not count.
bool isBroken(const Plot& plot, std::size_t left, std::size_t right, std::size_t count);

/// Decimals of a force or torque at one moment, in pictures and beside plots: 2 for "N", 3 for "N·m". Empty
/// for other units; there the axis decides.
std::optional<int> momentDecimals(std::string_view shown_unit);
/// "3.12 N", "0.046 N·m"
std::string momentText(double value, std::string_view unit);

/// "force, N"
std::string headingOf(const Plot& plot);

// --- axes

struct AxisSpan {
  double low = 0, high = 1;
};
/// Returns the y range for the data (none: an empty plot), without margins or rounding. It contains the data,
/// the limits, and zero if that is near, and spans at least `leastSpanOf`: centred on the data, but not
/// beyond zero if all data lie on one side. A `low` or `high` set in the plot is kept.
AxisSpan fittedSpan(const Plot& plot, const std::optional<AxisSpan>& data);

struct AxisTicks {
  double low = 0, high = 1;  ///< the axis, widened to round numbers if requested
  double step = 0.2;         ///< 1, 2 or 5 times a power of ten
  int decimals = 1;          ///< enough to distinguish the ticks
  std::vector<double> at;    ///< all multiples of step in [low, high]
};
/// About `wanted` ticks, and at least 2 unless `min_step` (1 for counts) allows fewer. Replaces an empty,
/// reversed or non-finite range by a valid one around it.
AxisTicks axisTicks(double low, double high, int wanted, bool widen, double min_step = 0);
/// Formats the value with `decimals`; minus is U+2212, never "-0".
std::string tickText(double value, int decimals);
/// Minutes and seconds "m:ss", with tenths if `decimals` is 1: for time lines.
std::string clockText(double seconds, int decimals = 0);

}  // namespace needlelab
