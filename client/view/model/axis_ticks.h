/// Round numbers for axes.
#pragma once

#include <string>
#include <vector>

namespace needlelab {

struct AxisTicks {
  double low = 0, high = 1;  ///< the axis, widened to round numbers where asked for
  double step = 0.2;         ///< 1, 2 or 5 times a power of ten
  int decimals = 1;          ///< that tell the ticks apart
  std::vector<double> at;    ///< all multiples of step in [low, high]
};
/// About `wanted` ticks, at least 2 unless `least_step` (1 for what is counted) leaves fewer. A range without
/// width, turned round or not finite gets one about it.
AxisTicks axisTicks(double low, double high, int wanted, bool widen, double least_step = 0);
/// With so many decimals, the minus as U+2212, no "-0".
std::string tickText(double value, int decimals);
/// Minutes and seconds "m:ss", with tenths where `decimals` is 1: for time lines.
std::string clockText(double seconds, int decimals = 0);

}  // namespace needlelab
