#include <algorithm>

#include "common/scoring/groups.h"
#include "common/scoring/smoothness.h"

namespace needlelab {
namespace {

/// The longest stretch of a run from which smoothness is taken: from the first to the last moment in tissue;
/// of gestures that never enter tissue, the whole of the longest run.
std::vector<double> speedProfile(const Gesture& gesture, double& period_s) {
  const Run* best = nullptr;
  std::size_t from = 0, to = 0;
  double longest_s = 0;
  bool best_in_tissue = false;
  for (const Run& run : gesture.runs) {
    if (run.inside.empty()) continue;
    const auto isIn = [](double share) { return share > 0; };
    const auto first = std::find_if(run.inside.begin(), run.inside.end(), isIn);
    const auto last = std::find_if(run.inside.rbegin(), run.inside.rend(), isIn);
    const bool in_tissue = first != run.inside.end();
    const auto begin = in_tissue ? static_cast<std::size_t>(first - run.inside.begin()) : 0;
    const auto end = in_tissue ? static_cast<std::size_t>(run.inside.rend() - last) : run.inside.size();
    const double length_s = static_cast<double>(end - begin) * run.period_s;
    if (best == nullptr || (in_tissue && !best_in_tissue) ||
        (in_tissue == best_in_tissue && length_s > longest_s)) {
      best = &run, from = begin, to = end, longest_s = length_s, best_in_tissue = in_tissue;
    }
  }
  std::vector<double> speeds;
  if (best == nullptr) return speeds;
  period_s = best->period_s;
  for (std::size_t i = from; i <= to; ++i) speeds.push_back(norm(best->points[i].v_WT_mps));
  return speeds;
}

/// Area that the shaft sweeps while it goes from one point of the track to the next with `length_m` of it in
/// tissue: the shaft's points p − s·axis, s ∈ [0, length], each moved by a straight line; only the part of
/// the movement across the shaft sweeps. Midpoint rule over 8 pieces (the integrand is the norm of a linear
/// function of s).
double sweptArea(const TrackPoint& a, const TrackPoint& b, double length_m) {
  constexpr int kPieces = 8;
  const Vec3 axis = a.axis_W + b.axis_W;
  if (!(normSquared(axis) > 1e-12) || !(length_m > 0)) return 0;
  const Vec3 along = normalized(axis);
  const Vec3 tip = b.p_WT_m - a.p_WT_m, turn = b.axis_W - a.axis_W;
  double sum = 0;
  for (int i = 0; i < kPieces; ++i) {
    const Vec3 moved = tip - ((i + 0.5) / kPieces * length_m) * turn;
    sum += norm(moved - dot(moved, along) * along);
  }
  return sum / kPieces * length_m;
}

}  // namespace

/// - `elapsed_s`: last tick less first tick.
/// - `path_length_m`: sum of the tip's steps on the track. `path_in_tissue_m`: each step times the share of
/// its time in
///   tissue. `time_in_tissue_s`: that share summed.
/// - `mean_speed_m_s`: path over the time of the runs. `peak_speed_m_s`: greatest central difference on the
/// track.
/// - `tissue_damage_m2`: area swept by the shaft inside tissue; straight in and out sweeps none.
/// - `sparc`, `ldlj`: of the tip's speed from the first entry to the last exit (smoothness.h).
void addMotion(const Gesture& gesture, Rows& rows) {
  double path_m = 0, path_in_m = 0, time_s = 0, time_in_s = 0, peak_mps = 0, area_m2 = 0;
  for (const Run& run : gesture.runs) {
    for (const TrackPoint& point : run.points) peak_mps = std::max(peak_mps, norm(point.v_WT_mps));
    for (std::size_t i = 0; i < run.inside.size(); ++i) {
      const TrackPoint &a = run.points[i], &b = run.points[i + 1];
      const double step_m = norm(b.p_WT_m - a.p_WT_m);
      path_m += step_m;
      path_in_m += step_m * run.inside[i];
      time_s += run.period_s;
      time_in_s += run.period_s * run.inside[i];
      area_m2 += run.inside[i] * sweptArea(a, b, 0.5 * (a.insertion_m + b.insertion_m));
    }
  }
  const auto& samples = gesture.samples;
  const double elapsed_s =
      samples.empty() ? 0 : secondsBetween(samples.front(), samples.back(), gesture.rate_hz);
  rows.add("elapsed_s", elapsed_s);
  rows.add("path_length_m", path_m);
  rows.add("time_in_tissue_s", time_in_s);
  rows.add("path_in_tissue_m", path_in_m);
  rows.add("mean_speed_m_s", time_s > 0 ? path_m / time_s : 0);
  rows.add("peak_speed_m_s", peak_mps);
  rows.add("tissue_damage_m2", area_m2);

  double period_s = 0;
  const std::vector<double> speeds = speedProfile(gesture, period_s);
  if (!(period_s > 0)) return;
  if (const auto value = sparc(speeds, 1 / period_s)) rows.add("sparc", *value);
  if (const auto value = ldlj(speeds, 1 / period_s)) rows.add("ldlj", *value);
}

}  // namespace needlelab
