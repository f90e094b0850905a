/// The zero of a force sensor: what it says above the skin, where a needle meets nothing. Pure.
#pragma once

#include <vector>

#include "common/curves/curve_phases.h"

namespace needlelab {

/// A line through the forces of the rows above the skin, over time (over the way, if time is unknown).
struct ForceZero {
  double mean_N = 0, drift_N = 0;  ///< both 0: the sensor was tared
  std::vector<double> at_row_N;    ///< the line, per row; empty if both are 0
};

/// `rows`: with depth, in the file's order. Off is a mean, or a drift from the first row to the last, above 2
/// % of the curve's range of forces and above 4 of its standard errors. Fewer than kMinCurveRows rows above
/// the skin say nothing.
ForceZero zeroOf(const CurveRows& rows);

}  // namespace needlelab
