#include "common/curves/curve_phases.h"

#include <fmt/core.h>

#include <algorithm>
#include <numeric>
#include <utility>

namespace needlelab {
namespace {

// Detects depths and forces with the wrong sign, and rows that go back in the middle of an insertion.
Status checkDirections(const std::string& where, const std::vector<double>& depth_m,
                       const std::vector<double>& force_N, bool digitised) {
  const auto count = static_cast<double>(depth_m.size());
  const double mean_N = std::accumulate(force_N.begin(), force_N.end(), 0.0) / count;
  const auto negative = std::count_if(depth_m.begin(), depth_m.end(), [](double depth) { return depth < 0; });
  if (2 * negative > static_cast<std::ptrdiff_t>(depth_m.size()))
    return wrongInput(where, fmt::format("{} of {} depths are negative: depth grows into the tissue; if the "
                                         "file counts it the other way, give --negate depth",
                                         negative, depth_m.size()));
  const auto [least, greatest] = std::minmax_element(depth_m.begin(), depth_m.end());
  const double noise_m = std::max(5e-4, 0.05 * (*greatest - *least));
  double deepest_m = depth_m.front();
  for (std::size_t i = 0; i < depth_m.size() && !digitised; ++i) {
    deepest_m = std::max(deepest_m, depth_m[i]);
    if (depth_m[i] < deepest_m - noise_m)
      return wrongInput(
          where,
          fmt::format("its row {} is at {} m after {} m: an insertion does not go back by more than {} "
                      "m; give each insertion its own name in a column 'curve', say what is a "
                      "withdrawal in a column 'phase', put the rows in order, or say that they are points of "
                      "a figure (--digitised)",
                      i + 1, numberText(depth_m[i]), numberText(deepest_m), numberText(noise_m)));
  }
  if (mean_N < 0)
    return wrongInput(where,
                      fmt::format("its mean force is {} N, which would pull the needle in: force on the "
                                  "needle is positive while it is pushed; if the file counts it the "
                                  "other way, give --negate force",
                                  numberText(mean_N)));
  return {};
}

void recognisePhases(const std::vector<double>& t_s, const std::vector<double>& depth_m,
                     std::vector<CurvePhase>& phases) {
  constexpr double kNear_m = 1e-4;
  const auto deepest = std::max_element(depth_m.begin(), depth_m.end());
  const auto is_near = [&](double depth) { return depth >= *deepest - kNear_m; };
  const auto indexOf = [&](auto at) { return static_cast<std::size_t>(at - depth_m.begin()); };
  std::size_t first = indexOf(std::find_if(depth_m.begin(), depth_m.end(), is_near));
  std::size_t end = indexOf(std::find_if(depth_m.rbegin(), depth_m.rend(), is_near).base());
  bool holds = false;
  if (!t_s.empty()) {
    const double speed_mps = (depth_m[first] - depth_m.front()) / std::max(1e-9, t_s[first] - t_s.front());
    const double turning_s = speed_mps > 0 ? 5 * kNear_m / speed_mps : 0;
    holds = end - first > kMinCurveRows && t_s[end - 1] - t_s[first] >= std::max(kMinHold_s, turning_s);
  }
  if (!holds) first = end = indexOf(deepest) + 1;
  const bool withdraws =
      indexOf(deepest) + 1 >= kMinCurveRows && depth_m.size() - end >= kMinCurveRows &&
      *deepest - *std::min_element(depth_m.begin() + static_cast<std::ptrdiff_t>(end - 1), depth_m.end()) >=
          kMinCurveDepth_m;
  if (!withdraws) end = depth_m.size();
  if (!withdraws && !holds) return;
  for (std::size_t i = holds ? first + 1 : end; i < depth_m.size(); ++i)
    phases[i] = i < end ? CurvePhase::kHold : CurvePhase::kWithdraw;
}

// Sorts the rows of one phase by depth: digitised curves go back in places.
void sortByDepth(std::vector<double>& depth_m, std::vector<double>& force_N) {
  std::vector<std::size_t> order(depth_m.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return depth_m[a] < depth_m[b]; });
  const auto depths = depth_m, forces = force_N;
  for (std::size_t i = 0; i < order.size(); ++i) {
    depth_m[i] = depths[order[i]];
    force_N[i] = forces[order[i]];
  }
}

}  // namespace

std::string_view nameOf(CurvePhase phase) {
  constexpr std::array<std::string_view, 3> kNames = {"insert", "hold", "withdraw"};
  return kNames[static_cast<std::size_t>(phase)];
}

Result<ForceCurve> curveOf(CurveRows rows) {
  ForceCurve curve = std::move(rows.curve);
  const std::string& where = rows.where;
  const bool has_time = !rows.t_s.empty();
  if (!rows.has_depth && !rows.has_phases) {
    if (rows.insertion_s == 0)
      return wrongInput(where,
                        "force over time only, and nothing says where the needle stops or turns: give "
                        "'depth_m', a column 'phase' (insert, hold, withdraw), or 'insertion_s' (s, how "
                        "long it goes in) in data_set.json");
    const auto end = std::upper_bound(rows.t_s.begin(), rows.t_s.end(), rows.t_s.front() + rows.insertion_s);
    const auto kept = static_cast<std::size_t>(end - rows.t_s.begin());
    rows.t_s.resize(kept);
    rows.phases.resize(kept);
    curve.depth_m.resize(kept);
    curve.force_N.resize(kept);
  }
  const std::vector<double> depth_m = std::move(curve.depth_m), force_N = std::move(curve.force_N);
  curve.depth_m.clear();
  curve.force_N.clear();
  if (rows.has_depth && !rows.has_phases && !rows.digitised) {
    recognisePhases(rows.t_s, depth_m, rows.phases);
    curve.phases_recognised = true;
  }
  double held_from_m = depth_m.front(), held_to_m = depth_m.front();
  std::vector<double> in_s, out_s;
  for (std::size_t i = 0; i < depth_m.size(); ++i) {
    const double t_s = has_time ? rows.t_s[i] : 0;
    if (rows.phases[i] == CurvePhase::kHold) {
      if (curve.hold.t_s.empty()) held_from_m = held_to_m = depth_m[i];
      held_from_m = std::min(held_from_m, depth_m[i]);
      held_to_m = std::max(held_to_m, depth_m[i]);
      curve.hold.t_s.push_back(t_s);
      curve.hold.force_N.push_back(force_N[i]);
      continue;
    }
    const bool in = rows.phases[i] == CurvePhase::kInsert;
    (in ? in_s : out_s).push_back(t_s);
    (in ? curve.depth_m : curve.withdrawal.depth_m).push_back(depth_m[i]);
    (in ? curve.force_N : curve.withdrawal.force_N).push_back(force_N[i]);
  }
  const auto checkRows = [&](CurvePhase phase, std::size_t count) -> Status {
    if (count >= kMinCurveRows) return {};
    return wrongInput(
        where, fmt::format("{} has {} rows; at least {} are needed", nameOf(phase), count, kMinCurveRows));
  };
  const auto checkWay = [&](CurvePhase phase, const std::vector<double>& sorted_m) -> Status {
    const double way_m = sorted_m.back() - sorted_m.front();
    if (way_m >= kMinCurveDepth_m) return {};
    return wrongInput(where, fmt::format("{} goes over {} m; at least {} m are needed", nameOf(phase),
                                         numberText(way_m), numberText(kMinCurveDepth_m)));
  };
  const auto speedOf = [&](CurvePhase phase, double way_m, const std::vector<double>& t_s) -> Result<double> {
    const double seconds = t_s.back() - t_s.front(), speed_mps = seconds > 0 ? way_m / seconds : 0;
    if (kCurveSpeed_mps.contains(speed_mps)) return speed_mps;
    return wrongInput(
        where,
        fmt::format("the depths and times of {} give a speed of {} m/s, out of range {}; give a column "
                    "'phase', or 'speed_m_s'",
                    nameOf(phase), numberText(speed_mps), rangeText(kCurveSpeed_mps)));
  };
  RETURN_IF_ERROR(checkRows(CurvePhase::kInsert, curve.depth_m.size()));
  if (curve.speed_mps == 0) {
    ASSIGN_OR_RETURN(curve.speed_mps,
                     speedOf(CurvePhase::kInsert, curve.depth_m.back() - curve.depth_m.front(), in_s));
  }
  if (!rows.has_depth)
    for (std::size_t i = 0; i < in_s.size(); ++i) {
      curve.depth_m[i] = (in_s[i] - in_s.front()) * curve.speed_mps;
      if (!kCurveDepth_m.contains(curve.depth_m[i]))
        return wrongInput(
            where, fmt::format("its times and speed give a depth of {} m, out of range {}; give a column "
                               "'phase', or 'depth_m'",
                               numberText(curve.depth_m[i]), rangeText(kCurveDepth_m)));
    }
  RETURN_IF_ERROR(checkDirections(where, curve.depth_m, curve.force_N, rows.digitised));
  sortByDepth(curve.depth_m, curve.force_N);
  RETURN_IF_ERROR(checkWay(CurvePhase::kInsert, curve.depth_m));
  if (CurveHold& hold = curve.hold; !hold.t_s.empty()) {
    RETURN_IF_ERROR(checkRows(CurvePhase::kHold, hold.t_s.size()));
    hold.depth_m = 0.5 * (held_from_m + held_to_m);
    if (!rows.has_depth) hold.depth_m = curve.depth_m.back();
    if (held_to_m - held_from_m > kMaxHoldWay_m)
      return wrongInput(
          where, fmt::format("hold goes from {} m to {} m; at most {} m apart", numberText(held_from_m),
                             numberText(held_to_m), numberText(kMaxHoldWay_m)));
    const double from_s = hold.t_s.front();
    for (double& t_s : hold.t_s) t_s -= from_s;
    if (hold.t_s.back() < kMinHold_s || hold.t_s.back() > kMaxHold_s)
      return wrongInput(where,
                        fmt::format("hold lasts {} s, out of range [{}, {}]", numberText(hold.t_s.back()),
                                    numberText(kMinHold_s), numberText(kMaxHold_s)));
  }
  if (CurveWithdrawal& out = curve.withdrawal; !out.depth_m.empty()) {
    RETURN_IF_ERROR(checkRows(CurvePhase::kWithdraw, out.depth_m.size()));
    out.speed_mps = curve.speed_mps;
    if (has_time) {
      ASSIGN_OR_RETURN(out.speed_mps,
                       speedOf(CurvePhase::kWithdraw, out.depth_m.front() - out.depth_m.back(), out_s));
    }
    sortByDepth(out.depth_m, out.force_N);
    RETURN_IF_ERROR(checkWay(CurvePhase::kWithdraw, out.depth_m));
  }
  return curve;
}

}  // namespace needlelab
