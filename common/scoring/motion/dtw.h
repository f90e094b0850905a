/// Tip paths and their distance by dynamic time warping: the mean distance of two paths when each may wait
/// for the other.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/motion/recorded_samples.h"

namespace needlelab {

/// The tip's path from the first entry to the last exit in the limb's frame, one point per 1/kPathRateHz, in
/// m.
using TipPath = std::vector<Vec3>;

inline constexpr double kPathRateHz = 20;
/// Alignments may run ahead or behind by this share of the longer path, and by at least `kMinBand` points.
inline constexpr double kBandShare = 0.2;
inline constexpr std::size_t kMinBand = 20;
/// 5 minutes: a comparison then takes 14.4 million cells, about 70 ms; longer gestures are not compared.
inline constexpr std::size_t kMaxPathPoints = 6'000;

/// The symmetric form of Sakoe and Chiba (1978), without a limit on slopes: steps (1,0) and (0,1) count the
/// distance of their points once, (1,1) and the start twice; the sum is divided by the number of points of
/// both paths. The result is a mean distance in m: 0 for equal paths, symmetric in both paths, and at most d
/// for two paths whose paired points are shifted by d.
///
/// `band`: the number of points by which an alignment may leave the straight line between both ends; at least
/// 1 is used. Empty: a path has no points, or more than kMaxPathPoints. Time O(longer · band), memory
/// O(band).
std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band);

/// With the band that scores use.
std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b);

/// The cost of dtwDistance for paths of `a` and `b` points with the band that scores use: an upper estimate
/// of the number of cells (pairs of points). 0: it computes nothing.
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
/// Returns the alignment for dtwDistance, with the same distance bit for bit. Among equally short alignments,
/// prefers steps (1,1) to steps (1,0) of the longer path, and those to (0,1). Memory O(longer · band) bytes:
/// at most 15 MB.
std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band);
/// With the band that scores use.
std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b);

/// The tip's path in a recording, from the smoothed track; empty if it was never in tissue. Joins the
/// stretches between long gaps. `rate_hz`, `X_WL`: as for `scoreGesture`. Thread: any.
TipPath tipPathOf(std::span<const GestureSample> samples, double rate_hz, const Pose& X_WL);
/// The same for a recording that is decoded block by block; check samples.fault() afterwards.
TipPath tipPathOf(const RecordedSamples& samples, double rate_hz, const Pose& X_WL);

}  // namespace needlelab
