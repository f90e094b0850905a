/// Two numbers over depth, linear between rows, constant beyond the ends.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <vector>

namespace needlelab {

struct DepthTable {
  struct Row {
    double depth_m = 0;
    double a = 0, a_slope = 0;  ///< at the row, and per metre below it
    double b = 0, b_slope = 0;
  };
  /// Sorted by depth; the first row is at 0 or above, the last has slopes 0. Never empty.
  std::vector<Row> rows;

  struct Pair {
    double a = 0, b = 0;
  };
  /// `row` is where the search starts; set to the row found. Real-time safe.
  [[nodiscard]] Pair at(double depth_m, std::uint32_t& row) const noexcept {
    const auto count = static_cast<std::uint32_t>(rows.size());
    assert(row < count);
    // nearly always the same row or the next
    if (row + 1 < count && depth_m >= rows[row + 1].depth_m) ++row;
    if (depth_m < rows[row].depth_m || (row + 1 < count && depth_m >= rows[row + 1].depth_m)) [[unlikely]] {
      const auto after = std::upper_bound(rows.begin(), rows.end(), depth_m,
                                          [](double depth, const Row& r) { return depth < r.depth_m; });
      row = after == rows.begin() ? 0 : static_cast<std::uint32_t>(after - rows.begin()) - 1;
    }
    const Row& found = rows[row];
    const double below_m = std::max(0.0, depth_m - found.depth_m);
    return {found.a + found.a_slope * below_m, found.b + found.b_slope * below_m};
  }

  /// Add rows in order; `finish` then sets the slopes.
  void add(double depth_m, double a, double b) {
    assert(rows.empty() || depth_m >= rows.back().depth_m);
    rows.push_back({depth_m, a, 0, b, 0});
  }
  void finish() {
    for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
      const double length_m = rows[i + 1].depth_m - rows[i].depth_m;
      rows[i].a_slope = (rows[i + 1].a - rows[i].a) / length_m;
      rows[i].b_slope = (rows[i + 1].b - rows[i].b) / length_m;
    }
  }
};

}  // namespace needlelab
