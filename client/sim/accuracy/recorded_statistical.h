/// Checks that the statistical model's insertions follow the distribution in its section. The draws run
/// through the engine.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// A synthetic distribution for checking the sampler (it has no recording as its source): mean 0.8-3 N, sd
/// 15-38 % of it.
StatisticalSpec syntheticStatistics();

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

struct DrawnAtDepth {
  double depth_m = 0;
  ForceLaw asked, drawn;
  double in_band = 0;  ///< share of the draws within the asked law's central 95 %
};
struct StatisticalDraws {
  std::vector<DrawnAtDepth> depths;
  /// From the correlation of normal scores at the given depths and one correlation length below each; mean
  /// over depths.
  double correlation_length_m = 0;
  double correlation = 0;  ///< at that distance; e⁻¹ is asked
  std::size_t draws = 0;
};

/// Inserts a needle `draws` times through a scene with this section (0.1 mm per tick), and takes the force
/// that the engine gives at each depth; `depths_m` ascending. Wall of `stiffness_N_per_m`. Errors: those of
/// `compile`.
Result<StatisticalDraws> drawStatistical(const StatisticalSpec& spec, const std::vector<double>& depths_m,
                                         std::size_t draws, double stiffness_N_per_m);

}  // namespace needlelab
