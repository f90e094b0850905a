/// Where the names of points stand in a picture, so that none covers another or a point.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace needlelab {

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

/// Where names may stand, and what else is there.
struct LabelSpace {
  PixelBox frame;                      ///< names stay within
  std::vector<PixelBox> lines;         ///< should stay readable: covered only where there is no other place
  double letter_px = 8, line_px = 15;  ///< size of a letter
};

/// Places `labels[i]` near `points[i]` (empty ones are left out), the nearest free place first: never over
/// another name or a point. A label for which there is no such place is left out.
std::vector<PlacedLabel> placeLabels(const std::vector<PixelPoint>& points,
                                     const std::vector<std::string>& labels, const LabelSpace& space);

}  // namespace needlelab
