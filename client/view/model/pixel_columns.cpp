#include "client/view/model/pixel_columns.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

void fillColumns(std::span<const double> x, std::span<const double> y, double from, double to,
                 std::span<PixelColumn> out) {
  std::fill(out.begin(), out.end(), PixelColumn{});
  if (out.empty() || !(to > from)) return;
  const double per_x = static_cast<double>(out.size()) / (to - from);
  const std::size_t count = std::min(x.size(), y.size());
  const auto begin = x.begin(), end = x.begin() + static_cast<std::ptrdiff_t>(count);
  for (auto at = std::lower_bound(begin, end, from); at != end && *at < to; ++at) {
    const double value = y[static_cast<std::size_t>(at - begin)];
    if (!std::isfinite(value)) continue;
    const auto column = std::min(static_cast<std::size_t>((*at - from) * per_x), out.size() - 1);
    out[column].take(static_cast<float>(value));
  }
}

ColumnSource columnsOf(std::span<const double> x, std::span<const double> y) {
  return [x, y](double from, double to, std::span<PixelColumn> out) { fillColumns(x, y, from, to, out); };
}

}  // namespace needlelab
