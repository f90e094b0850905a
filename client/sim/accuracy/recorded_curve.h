/// Models fitted to a part of a recorded force-depth curve, and their error on the part held out. The model
/// runs through the engine, with the needle going in at the recording's speed.
#pragma once

#include <functional>
#include <vector>

#include "client/sim/accuracy/baseline.h"
#include "client/sim/accuracy/recorded_data.h"
#include "client/sim/accuracy/recorded_fit.h"
#include "client/sim/accuracy/recorded_models.h"

namespace needlelab {

inline constexpr double kRecordedSpeed_mps = 0.003;  ///< of bovine_liver_heart_18g
/// Errors are taken per bin; blocks are fitted on or held out as a whole.
inline constexpr double kDepthBin_m = 0.00025, kDepthBlock_m = 0.0005;
/// Where the extrapolation begins: the first rupture is before it, three are behind.
inline constexpr double kExtrapolateFrom_m = 0.025;
/// Models are compared once as they come, and once with no more than so many numbers each: who has more
/// numbers follows more closely.
inline constexpr std::size_t kEqualNumbers = 20;

/// A curve with its bins.
struct DepthCurve {
  std::vector<double> depth_m, force_N;
  std::vector<CurveBin> bins;
};
DepthCurve depthCurve(const std::vector<ForceAtDepth>& rows);

using BinChoice = std::function<bool(const CurveBin&)>;
/// Every second block: `fold` 0 or 1 is the one that is held out.
BinChoice alternateBlocks(int fold);
/// All before kExtrapolateFrom_m.
BinChoice beforeTheSplit();

struct CurveFit {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;
  std::size_t parameters = 0;
  std::vector<double> values;
  CurveScene scene;
  CurveError fitted, held_out;
  std::vector<double> model_N;  ///< at each row of the curve
  int evaluations = 0;
};

/// The pattern search for scenes with ruptures: again from where it ended, with full steps, until that helps
/// no more, since ruptures make many small valleys.
FitResult searchAgain(const std::function<double(const std::vector<double>&)>& cost,
                      const std::vector<FitParameter>& parameters);

/// Fits on the bins that `fit_on` chooses; the others are held out. Errors: those of `compile`; kInvalidInput
/// without bins.
Result<CurveFit> fitCurve(const DepthCurve& curve, const CurveModel& model, const BinChoice& fit_on);

/// The bins to fit on.
std::vector<CurveBin> chosenBins(const DepthCurve& curve, const BinChoice& fit_on);

/// The baseline through the bins that `fit_on` chooses, or through `most_numbers` means of them.
struct BaselineFit {
  Baseline baseline = Baseline::kConnectTheDots;
  std::size_t parameters = 0;  ///< the bins that it goes through
  CurveError fitted, held_out;
};
/// Errors: kInvalidInput without bins.
Result<BaselineFit> fitBaseline(const DepthCurve& curve, Baseline baseline, const BinChoice& fit_on,
                                std::size_t most_numbers = kAnyNumbers);

/// The engine's force over recorded depth for a scene, to `to_m`.
struct CurveRun {
  StraightGesture gesture;  ///< depth below the scene's surface
  AxialRun run;
};
Result<CurveRun> runCurve(const CurveScene& scene, double to_m, double rate_hz = 1000,
                          double speed_mps = kRecordedSpeed_mps);
/// Its force at each depth; 0 before the needle is in.
std::vector<double> forceAtDepths(const CurveRun& run, double surface_m, const std::vector<double>& depth_m);

/// One specimen does not show how patients differ: the spread is that of the digitised rows about the table
/// (within 1 mm of each table row), the correlation length the default.
StatisticalSpec spreadAround(const DepthCurve& curve, const CurveFit& table, const BinChoice& fit_on);

struct SpreadCheck {
  CurveError held_out_of_mean;  ///< of the mean of all insertions
  double held_out_rms = 0;      ///< of one insertion, mean over insertions
  double held_out_max = 0;      ///< of one insertion, greatest
  double spread_of_rms = 0;     ///< standard deviation of `held_out_rms` over insertions
  double in_band = 0;      ///< share of the rows held out, once in contact, within the law's central 95 %
  std::size_t blocks = 0;  ///< that these rows are from: rows of one block are not independent
  CurveScene scene;
};
/// Through the engine, `insertions` times. Errors: those of `compile`.
Result<SpreadCheck> checkSpread(const DepthCurve& curve, const StatisticalSpec& spec, const BinChoice& fit_on,
                                int insertions);

}  // namespace needlelab
