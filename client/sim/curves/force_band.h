/// The 95 % band of a distribution of forces, and what the share of data within it says.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The log-normal law of a mean and a standard deviation: quantiles of its central 95 %.
struct ForceBand {
  double low_N = 0, high_N = 0;
};
ForceBand centralBand95(double mean_N, double sd_N);

/// What the share of data within a 95 % band says of it: "kept", "MISSED: too narrow", "MISSED: too wide" or
/// "cannot tell", with Wilson's 95 % interval of the share. `independent`: how many data there were, counting
/// those that follow one another as one. `kept` means not contradicted.
struct BandVerdict {
  double low = 0, high = 1;  ///< the interval
  std::string text;
};
BandVerdict bandVerdict(double share, std::size_t independent);

/// The law of the section at a depth, linear between rows.
struct ForceLaw {
  double mean_N = 0, sd_N = 0;
};
ForceLaw forceLawAt(const StatisticalSpec& spec, double depth_m);

}  // namespace needlelab
