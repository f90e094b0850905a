/// STATISTICAL on one recorded curve: the fitted table as its mean, and how the curve scatters about that as
/// its standard deviation.
#pragma once

#include "client/sim/accuracy/recorded_curve.h"

namespace needlelab {

/// One specimen says nothing of how patients differ: the spread is that of the digitised rows about the table
/// (within 1 mm of each table row), the correlation length DESIGN's default.
StatisticalSpec spreadAround(const DepthCurve& curve, const CurveFit& table, const BinChoice& fit_on);

struct SpreadCheck {
  CurveError held_out_of_mean;  ///< of the mean of all insertions
  double held_out_rms = 0;      ///< of one insertion, mean over insertions
  double held_out_max = 0;      ///< of one insertion, greatest
  double spread_of_rms = 0;     ///< standard deviation of `held_out_rms` over insertions
  double in_band = 0;  ///< share of the rows held out, once in contact, within the law's central 95 %
  CurveScene scene;
};
/// Through the engine, `insertions` times. Errors: those of `compile`.
Result<SpreadCheck> checkSpread(const DepthCurve& curve, const StatisticalSpec& spec, const BinChoice& fit_on,
                                int insertions);

}  // namespace needlelab
