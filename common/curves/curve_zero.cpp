#include "common/curves/curve_zero.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace needlelab {

ForceZero zeroOf(const CurveRows& rows) {
  constexpr double kBelowSkin_m = -1e-4, kOff = 0.02, kErrors = 4;
  const std::vector<double>&depth_m = rows.curve.depth_m, &force_N = rows.curve.force_N;
  ForceZero zero;
  if (!rows.has_depth || rows.digitised) return zero;
  std::vector<double> at = rows.t_s;
  for (std::size_t i = at.size(); i < depth_m.size(); ++i)
    at.push_back(i == 0 ? 0 : at.back() + std::abs(depth_m[i] - depth_m[i - 1]));
  std::vector<std::size_t> above;
  for (std::size_t i = 0; i < depth_m.size(); ++i)
    if (depth_m[i] < kBelowSkin_m) above.push_back(i);
  if (above.size() < kMinCurveRows) return zero;
  const auto count = static_cast<double>(above.size());
  double at_mean = 0, mean_N = 0, at_at = 0, at_force = 0, rest = 0;
  for (const std::size_t i : above) {
    at_mean += at[i] / count;
    mean_N += force_N[i] / count;
  }
  for (const std::size_t i : above) {
    at_at += (at[i] - at_mean) * (at[i] - at_mean);
    at_force += (at[i] - at_mean) * (force_N[i] - mean_N);
  }
  double slope = at_at > 0 ? at_force / at_at : 0;
  for (const std::size_t i : above) rest += std::pow(force_N[i] - mean_N - slope * (at[i] - at_mean), 2);
  const double noise_N = std::sqrt(rest / (count - 2));
  const auto [least, greatest] = std::minmax_element(force_N.begin(), force_N.end());
  const double range_N = *greatest - *least, drift_N = slope * (at.back() - at.front());
  const bool drifts =
      std::abs(drift_N) > kOff * range_N && std::abs(slope) * std::sqrt(at_at) > kErrors * noise_N;
  if (!drifts) slope = 0;
  if (!drifts && !(std::abs(mean_N) > std::max(kOff * range_N, kErrors * noise_N / std::sqrt(count))))
    return zero;
  zero.mean_N = mean_N;
  zero.drift_N = drifts ? drift_N : 0;
  for (const double x : at) zero.at_row_N.push_back(mean_N + slope * (x - at_mean));
  return zero;
}

}  // namespace needlelab
