/// Statistics for few independent values: intervals of a mean and of a share.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace needlelab {

/// Probability that |t| is at least this, for Student's t with `freedom` degrees of freedom (at least 1).
/// Closed form (Abramowitz and Stegun 26.7.3 and 26.7.4).
double studentTail(double t, std::size_t freedom);
/// The t that |t| exceeds with probability `tail`, in (0, 1).
double studentQuantile(double tail, std::size_t freedom);

/// A mean of independent values with its 95 % interval by Student's t, not clamped. With one value there is
/// no interval: low and high are infinite.
struct MeanInterval {
  double mean = 0, low = 0, high = 0;
  std::size_t count = 0;
};
MeanInterval meanInterval(std::span<const double> values);

inline constexpr double kNormal975 = 1.959963984540054;  ///< quantile of the unit normal at 0.975

/// Wilson's 95 % interval (1927) of a probability of which `share` of `count` trials were hits; 0 to 1
/// without trials.
struct ShareInterval {
  double low = 0, high = 1;
};
ShareInterval wilsonInterval(double share, std::size_t count);

}  // namespace needlelab
