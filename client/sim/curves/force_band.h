/// The 95 % band of a distribution of forces, and what the share of data within it means.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Central 95 % of the log-normal distribution with this mean and standard deviation.
struct ForceBand {
  double low_N = 0, high_N = 0;
};
ForceBand centralBand95(double mean_N, double sd_N);

/// Verdict from the share of data within a 95 % band: "kept", "MISSED: too narrow", "MISSED: too wide" or
/// "cannot tell", with Wilson's 95 % interval of the share. `independent`: number of data, where consecutive
/// correlated ones count once. `kept` means not contradicted.
struct BandVerdict {
  double low = 0, high = 1;  ///< the interval
  std::string text;
};
BandVerdict bandVerdict(double share, std::size_t independent);

/// The section's distribution at a depth, interpolated linearly between rows.
struct ForceLaw {
  double mean_N = 0, sd_N = 0;
};
ForceLaw forceLawAt(const StatisticalSpec& spec, double depth_m);

}  // namespace needlelab
