/// Paths of tips and their distance by dynamic time warping: the mean distance of two paths when each may
/// wait for the other.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/recorded_samples.h"

namespace needlelab {

/// The tip's path from the first entry to the last exit in the limb's frame, one point per 1/kPathRateHz, in
/// m.
using TipPath = std::vector<Vec3>;

inline constexpr double kPathRateHz = 20;
/// Alignments may run ahead or behind by this share of the longer path, and by `kLeastBand` points at least.
inline constexpr double kBandShare = 0.2;
inline constexpr std::size_t kLeastBand = 20;
/// 5 minutes: a comparison then takes 14.4 million cells, some 70 ms; longer gestures are not compared.
inline constexpr std::size_t kMostPathPoints = 6'000;

/// The symmetric form of Sakoe and Chiba (1978), without a limit on slopes: steps (1,0) and (0,1) count the
/// distance of their points once, (1,1) and the start twice, the sum is divided by the number of points of
/// both paths. So it is a mean distance in m, 0 for equal paths, symmetric in both paths, and with
/// points in pairs for a shift by d everywhere at most d.
///
/// `band`: the number of points by which an alignment may leave the straight line between both ends; at least
/// 1 is used. Empty: a path has no points, or more than kMostPathPoints. Time O(longer · band), memory
/// O(band).
std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band);

/// With the band that scores use.
std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b);

/// The number of cells (pairs of points) that dtwDistance computes for paths of so many points with the band
/// that scores use, or somewhat more: its cost. 0: it computes nothing.
std::size_t dtwCells(std::size_t a, std::size_t b);

/// An alignment of the points of `a` and `b`.
struct DtwPair {
  std::size_t a = 0, b = 0;
  friend constexpr bool operator==(const DtwPair&, const DtwPair&) = default;
};
struct DtwAlignment {
  double distance_m = 0;       ///< as dtwDistance
  std::vector<DtwPair> pairs;  ///< from (0, 0) to both ends; each step raises a, b or both by 1
};
/// Returns the alignment of dtwDistance, with bit for bit the same distance. Among equally short alignments,
/// steps (1,1) are preferred to steps (1,0) of the longer path, and those to (0,1). Memory O(longer · band)
/// bytes: 15 MB at the most.
std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band);
/// With the band that scores use.
std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b);

/// The tip's path of a recording (dtw.h), from the smoothed track; empty if it was never in tissue. The
/// stretches between long gaps are joined. `rate_hz`, `X_WL`: as for `scoreGesture`. Thread: any.
TipPath tipPathOf(std::span<const GestureSample> samples, double rate_hz, const Pose& X_WL);
/// The same of a recording that is decoded block by block; see samples.fault() afterwards.
TipPath tipPathOf(const RecordedSamples& samples, double rate_hz, const Pose& X_WL);

}  // namespace needlelab
