#include "scoring/dtw.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace needlelab {

std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band) {
  if (a.empty() || b.empty() || a.size() > kMostPathPoints || b.size() > kMostPathPoints) return std::nullopt;
  // rows run along the longer path: the band's middle then moves by at most one point a row, so that the
  // windows of neighbouring rows meet, and the order of the two does not matter
  if (a.size() < b.size()) std::swap(a, b);
  band = std::max<std::size_t>(1, band);
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const std::size_t rows = a.size(), columns = b.size();

  std::vector<double> before(columns < 2 * band + 1 ? columns : 2 * band + 1, kNone), now(before);
  std::size_t before_first = 0, before_end = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    const std::size_t middle =
        rows == 1 ? 0 : (2 * i * (columns - 1) + (rows - 1)) / (2 * (rows - 1));  // rounded
    const std::size_t first = middle > band ? middle - band : 0;
    const std::size_t end = std::min(columns, middle + band + 1);
    for (std::size_t j = first; j < end; ++j) {
      const double d = norm(a[i] - b[j]);
      const auto above = [&](std::size_t column) {
        return column >= before_first && column < before_end ? before[column - before_first] : kNone;
      };
      double best = kNone;
      if (i == 0 && j == 0) best = 2 * d;
      if (j > first) best = std::min(best, now[j - 1 - first] + d);
      best = std::min(best, above(j) + d);
      if (j > 0) best = std::min(best, above(j - 1) + 2 * d);
      now[j - first] = best;
    }
    std::swap(before, now);
    before_first = first;
    before_end = end;
  }
  const double sum = before[columns - 1 - before_first];
  if (!std::isfinite(sum)) return std::nullopt;
  return sum / static_cast<double>(rows + columns);
}

std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b) {
  const double longer = static_cast<double>(std::max(a.size(), b.size()));
  return dtwDistance(a, b, std::max(kLeastBand, static_cast<std::size_t>(std::ceil(kBandShare * longer))));
}

}  // namespace needlelab
