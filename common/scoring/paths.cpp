#include "common/scoring/paths.h"

#include <algorithm>
#include <cmath>

#include "common/haptics/limits.h"
#include "common/scoring/groups.h"

namespace needlelab {

TipPath tipPathOf(const Gesture& gesture, const Pose& X_WL) {
  // first entry and last exit, in s since the first sample
  double from_s = -1, to_s = -1;
  for (const Run& run : gesture.runs) {
    for (std::size_t i = 0; i < run.inside.size(); ++i) {
      if (!(run.inside[i] > 0)) continue;
      const double at_s = run.start_s + static_cast<double>(i) * run.period_s;
      if (from_s < 0) from_s = at_s;
      to_s = at_s + run.period_s;
    }
  }
  TipPath path;
  if (from_s < 0) return path;
  const Pose X_LW = inverse(Pose{X_WL.p, normalized(X_WL.q)});
  for (const Run& run : gesture.runs) {
    if (run.inside.empty()) continue;
    const double begin_s = std::max(from_s, run.start_s);
    const double end_s = std::min(to_s, run.start_s + static_cast<double>(run.inside.size()) * run.period_s);
    for (std::size_t k = 0; path.size() <= kMostPathPoints; ++k) {
      const double at_s = begin_s + static_cast<double>(k) / kPathRateHz;
      if (at_s > end_s + 1e-9) break;
      const double place = std::max(0.0, (at_s - run.start_s) / run.period_s);
      const std::size_t i = std::min(static_cast<std::size_t>(place), run.inside.size() - 1);
      const double share = std::min(1.0, place - static_cast<double>(i));
      const Vec3 a = run.points[i].p_WT_m, b = run.points[i + 1].p_WT_m;
      path.push_back(X_LW * (a + share * (b - a)));
    }
  }
  return path;
}

TipPath tipPathOf(std::span<const GestureSample> samples, double rate_hz, const Pose& X_WL) {
  if (!(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz)) return {};
  std::vector<GestureSample> storage;
  Gesture gesture;
  gesture.samples = cleaned(samples, storage);
  gesture.rate_hz = rate_hz;
  gesture.runs = runsOf(gesture.samples, rate_hz);
  return tipPathOf(gesture, X_WL);
}

/// - `dtw_distance_m`: of the path (dtw.h) from the nearest of the references; where there are any, and the
/// tip was in tissue.
void addReferences(const Gesture& gesture, const Pose& X_WL, std::span<const TipPath> references,
                   Rows& rows) {
  if (references.empty()) return;
  const TipPath path = tipPathOf(gesture, X_WL);
  std::optional<double> nearest;
  for (const TipPath& reference : references) {
    const auto distance = dtwDistance(path, reference);
    if (distance && (!nearest || *distance < *nearest)) nearest = distance;
  }
  if (nearest) rows.add("dtw_distance_m", *nearest);
}

}  // namespace needlelab
