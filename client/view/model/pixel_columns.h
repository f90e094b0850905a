/// Long series on few pixels: what is drawn in each column of a plot.
#pragma once

#include <functional>
#include <limits>
#include <span>
#include <vector>

namespace needlelab {

/// Least, greatest and last value in the time of one pixel column. Nothing fell there: min > max.
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

/// Gives `out.size()` columns of [from, to), oldest first. What a plot asks for, each frame.
using ColumnSource = std::function<void(double from, double to, std::span<PixelColumn> out)>;

/// Columns of points (x, y) with x ascending; values that are not finite are left out. O(log n + points in
/// the range).
void fillColumns(std::span<const double> x, std::span<const double> y, double from, double to,
                 std::span<PixelColumn> out);
/// The same as a source that refers to the two spans, which must outlive it.
ColumnSource columnsOf(std::span<const double> x, std::span<const double> y);

}  // namespace needlelab
