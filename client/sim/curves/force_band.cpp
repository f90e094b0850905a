#include "client/sim/curves/force_band.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/tools/small_sample.h"

namespace needlelab {
namespace {

struct LogNormal {
  double mu = 0, sigma = 0;
};
LogNormal logNormal(ForceLaw law) {
  const double share = law.sd_N / law.mean_N, variance = std::log1p(share * share);
  return {std::log(law.mean_N) - variance / 2, std::sqrt(variance)};
}

}  // namespace

ForceBand centralBand95(double mean_N, double sd_N) {
  const LogNormal law = logNormal({mean_N, sd_N});
  return {std::exp(law.mu - kNormal975 * law.sigma), std::exp(law.mu + kNormal975 * law.sigma)};
}

BandVerdict bandVerdict(double share, std::size_t independent) {
  // with fewer data, any share is compatible with a 95 % band
  constexpr std::size_t kLeast = 8;
  constexpr double kAsked = 0.95;
  BandVerdict verdict;
  if (independent == 0) {
    verdict.text = "cannot tell: no data";
    return verdict;
  }
  const ShareInterval interval = wilsonInterval(share, independent);
  verdict.low = interval.low;
  verdict.high = interval.high;
  const char* found = verdict.high < kAsked  ? "MISSED: too narrow"
                      : verdict.low > kAsked ? "MISSED: too wide"
                      : independent < kLeast ? "cannot tell"
                                             : "kept";
  verdict.text = fmt::format("{}, {:.0f} % inside ({:.0f} to {:.0f} %)", found, 100 * share,
                             100 * verdict.low, 100 * verdict.high);
  return verdict;
}

ForceLaw forceLawAt(const StatisticalSpec& spec, double depth_m) {
  const auto& table = spec.table;
  const auto after =
      std::lower_bound(table.begin(), table.end(), depth_m,
                       [](const StatisticalSpec::Row& row, double d) { return row.depth_m < d; });
  if (after == table.begin()) return {table.front().mean_N, table.front().sd_N};
  if (after == table.end()) return {table.back().mean_N, table.back().sd_N};
  const auto& before = *(after - 1);
  const double t = (depth_m - before.depth_m) / (after->depth_m - before.depth_m);
  return {std::lerp(before.mean_N, after->mean_N, t), std::lerp(before.sd_N, after->sd_N, t)};
}

}  // namespace needlelab
