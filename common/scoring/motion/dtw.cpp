#include "common/scoring/motion/dtw.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "common/haptics/scene_spec.h"
#include "common/scoring/motion/motion_cost.h"
#include "common/scoring/motion/track.h"

namespace needlelab {
namespace {

enum class Came : std::uint8_t { kAside, kAbove, kAcross };  // steps (0,1), (1,0), (1,1) of (row, column)

/// The step into each cell of the table, row by row; stored only if the caller needs the alignment.
struct Trail {
  struct Row {
    std::size_t first = 0, begin = 0;  // its first column, and the index of that column in `came`
  };
  std::vector<Row> rows;
  std::vector<Came> came;
};

std::size_t scoreBand(std::size_t a, std::size_t b) {
  const double longer = static_cast<double>(std::max(a, b));
  return std::max(kMinBand, static_cast<std::size_t>(std::ceil(kBandShare * longer)));
}

/// `a` is the longer path.
std::optional<double> warp(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band, Trail* trail) {
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
    if (trail != nullptr) trail->rows.push_back({first, trail->came.size()});
    for (std::size_t j = first; j < end; ++j) {
      const double d = norm(a[i] - b[j]);
      const auto above = [&](std::size_t column) {
        return column >= before_first && column < before_end ? before[column - before_first] : kNone;
      };
      double best = kNone;
      Came came = Came::kAcross;
      if (i == 0 && j == 0) best = 2 * d;
      if (j > 0) best = std::min(best, above(j - 1) + 2 * d);
      if (const double next = above(j) + d; next < best) {
        best = next;
        came = Came::kAbove;
      }
      if (j > first) {
        if (const double next = now[j - 1 - first] + d; next < best) {
          best = next;
          came = Came::kAside;
        }
      }
      now[j - first] = best;
      if (trail != nullptr) trail->came.push_back(came);
    }
    std::swap(before, now);
    before_first = first;
    before_end = end;
  }
  const double sum = before[columns - 1 - before_first];
  if (!std::isfinite(sum)) return std::nullopt;
  return sum / static_cast<double>(rows + columns);
}

bool comparable(std::size_t a, std::size_t b) {
  return a > 0 && b > 0 && a <= kMaxPathPoints && b <= kMaxPathPoints;
}

}  // namespace

std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band) {
  if (!comparable(a.size(), b.size())) return std::nullopt;
  // rows run along the longer path: the band's middle then moves by at most one point per row, so that the
  // windows of neighbouring rows overlap and the order of the two paths does not matter
  if (a.size() < b.size()) std::swap(a, b);
  return warp(a, b, band, nullptr);
}

std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b) {
  return dtwDistance(a, b, scoreBand(a.size(), b.size()));
}

std::size_t dtwCells(std::size_t a, std::size_t b) {
  if (!comparable(a, b)) return 0;
  return std::max(a, b) * std::min(std::min(a, b), 2 * scoreBand(a, b) + 1);
}

std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band) {
  if (!comparable(a.size(), b.size())) return std::nullopt;
  const bool swapped = a.size() < b.size();
  if (swapped) std::swap(a, b);
  Trail trail;
  const auto distance = warp(a, b, band, &trail);
  if (!distance) return std::nullopt;
  DtwAlignment alignment;
  alignment.distance_m = *distance;
  // trace back from both ends to both beginnings
  std::size_t i = a.size() - 1, j = b.size() - 1;
  for (;;) {
    alignment.pairs.push_back(swapped ? DtwPair{j, i} : DtwPair{i, j});
    if (i == 0 && j == 0) break;
    const Trail::Row& row = trail.rows[i];
    const Came came = trail.came[row.begin + (j - row.first)];
    if (came != Came::kAside) --i;
    if (came != Came::kAbove) --j;
  }
  std::reverse(alignment.pairs.begin(), alignment.pairs.end());
  return alignment;
}

std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b) {
  return dtwAlignment(a, b, scoreBand(a.size(), b.size()));
}

TipPath tipPathOf(std::span<const GestureSample> samples, double rate_hz, const Pose& X_WL) {
  return tipPathOf(RecordedSamples(samples), rate_hz, X_WL);
}

TipPath tipPathOf(const RecordedSamples& samples, double rate_hz, const Pose& X_WL) {
  if (!(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz) || !checkMotion(samples, rate_hz)) return {};
  return pathInTissue(runsOf(samples, rate_hz), X_WL, kPathRateHz, kMaxPathPoints);
}

}  // namespace needlelab
