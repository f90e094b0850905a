/// Models fitted to part of a recorded force-depth curve, and their error on the held-out part. The model
/// runs through the engine, with the needle entering at the recording's speed.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "client/sim/curves/baseline.h"
#include "client/sim/curves/curve_fit.h"
#include "client/sim/curves/curve_models.h"

namespace needlelab {

inline constexpr double kRecordedSpeed_mps = 0.003;  ///< of bovine_liver_heart_18g
/// Errors are computed per bin; blocks are fitted on or held out as a whole.
inline constexpr double kDepthBin_m = 0.00025, kDepthBlock_m = 0.0005;
/// Models are compared once as they are, and once with at most this many numbers each, because more numbers
/// follow a curve more closely.
inline constexpr std::size_t kEqualNumbers = 20;

/// A curve with its bins.
struct DepthCurve {
  std::vector<double> depth_m, force_N;
  std::vector<CurveBin> bins;
};

using BinChoice = std::function<bool(const CurveBin&)>;
/// Every second block: `fold` 0 or 1 is held out.
BinChoice alternateBlocks(int fold);

/// Pattern search for scenes with ruptures: restarts from its result with full steps until that no longer
/// helps, because ruptures create many small valleys.
FitResult searchAgain(const std::function<double(const std::vector<double>&)>& cost,
                      const std::vector<FitParameter>& parameters);

/// The engine's force over recorded depth for a scene, up to `to_m`.
struct CurveRun {
  StraightGesture gesture;  ///< depth below the scene's surface
  AxialRun run;
};
Result<CurveRun> runCurve(const CurveScene& scene, double to_m, double rate_hz = 1000,
                          double speed_mps = kRecordedSpeed_mps);
/// The run's force at each depth; 0 before the needle enters.
std::vector<double> forceAtDepths(const CurveRun& run, double surface_m, const std::vector<double>& depth_m);

}  // namespace needlelab
