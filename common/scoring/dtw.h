/// The paths of tips that are compared, and the distance between two of them by dynamic time warping: how far
/// apart they run when each may dwell where the other does.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// The tip's way from the first entry to the last exit in the limb's frame, a point each 1/kPathRateHz, m.
using TipPath = std::vector<Vec3>;

inline constexpr double kPathRateHz = 20;
/// Alignments may run ahead or behind by this share of the longer path, and by `kLeastBand` points at least.
inline constexpr double kBandShare = 0.2;
inline constexpr std::size_t kLeastBand = 20;
/// 5 minutes: a comparison takes 30 ms then; longer gestures are compared with none.
inline constexpr std::size_t kMostPathPoints = 6'000;

/// The symmetric form of Sakoe and Chiba (1978), without a limit on slopes: steps (1,0) and (0,1) count the
/// distance of their points once, (1,1) and the start twice, the sum is divided by the number of points of
/// both paths. So it is a mean distance in m, 0 for equal paths, the same whichever comes first, and with
/// points in pairs for a shift by d everywhere at most d.
///
/// `band`: how many points an alignment may leave the straight line between both ends, raised to 1. Empty: a
/// path without points, or with more than kMostPathPoints. Time O(longer · band), memory O(band).
std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band);

/// With the band that scores use.
std::optional<double> dtwDistance(std::span<const Vec3> a, std::span<const Vec3> b);

/// Which point of `b` stands beside which of `a`.
struct DtwPair {
  std::size_t a = 0, b = 0;
  friend constexpr bool operator==(const DtwPair&, const DtwPair&) = default;
};
struct DtwAlignment {
  double distance_m = 0;       ///< as dtwDistance
  std::vector<DtwPair> pairs;  ///< from (0, 0) to both ends; each step raises a, b or both by 1
};
/// The alignment behind dtwDistance, bit for bit the same distance. Where several are as short, steps (1,1)
/// go before (1,0) of the longer path, and those before (0,1). Memory O(longer · band) bytes: 15 MB at the
/// most.
std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b, std::size_t band);
/// With the band that scores use.
std::optional<DtwAlignment> dtwAlignment(std::span<const Vec3> a, std::span<const Vec3> b);

/// The tip's path of a recording (dtw.h), from the smoothed track; empty when it was never in tissue.
/// Stretches between long gaps follow each other. `rate_hz`, `X_WL`: as for `scoreGesture`. Thread: any.
TipPath tipPathOf(std::span<const GestureSample> samples, double rate_hz, const Pose& X_WL);

}  // namespace needlelab
