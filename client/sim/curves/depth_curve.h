/// Models fitted to a part of a recorded force-depth curve, and their error on the part held out. The model
/// runs through the engine, with the needle going in at the recording's speed.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "client/sim/curves/baseline.h"
#include "client/sim/curves/curve_fit.h"
#include "client/sim/curves/curve_models.h"

namespace needlelab {

inline constexpr double kRecordedSpeed_mps = 0.003;  ///< of bovine_liver_heart_18g
/// Errors are taken per bin; blocks are fitted on or held out as a whole.
inline constexpr double kDepthBin_m = 0.00025, kDepthBlock_m = 0.0005;
/// Models are compared once as they come, and once with no more than so many numbers each: who has more
/// numbers follows more closely.
inline constexpr std::size_t kEqualNumbers = 20;

/// A curve with its bins.
struct DepthCurve {
  std::vector<double> depth_m, force_N;
  std::vector<CurveBin> bins;
};

using BinChoice = std::function<bool(const CurveBin&)>;
/// Every second block: `fold` 0 or 1 is the one that is held out.
BinChoice alternateBlocks(int fold);

/// The pattern search for scenes with ruptures: again from where it ended, with full steps, until that helps
/// no more, since ruptures make many small valleys.
FitResult searchAgain(const std::function<double(const std::vector<double>&)>& cost,
                      const std::vector<FitParameter>& parameters);

/// The engine's force over recorded depth for a scene, to `to_m`.
struct CurveRun {
  StraightGesture gesture;  ///< depth below the scene's surface
  AxialRun run;
};
Result<CurveRun> runCurve(const CurveScene& scene, double to_m, double rate_hz = 1000,
                          double speed_mps = kRecordedSpeed_mps);
/// Its force at each depth; 0 before the needle is in.
std::vector<double> forceAtDepths(const CurveRun& run, double surface_m, const std::vector<double>& depth_m);

}  // namespace needlelab
