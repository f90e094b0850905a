/// Fits a model that is a program rather than a formula: a derivative-free search, and the error relative to
/// digitised curves.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// A number to fit, with its bounds and the search's first step.
struct FitParameter {
  std::string name;
  double start = 0, low = 0, high = 0, step = 0;
};

struct FitResult {
  std::vector<double> values;
  double cost = 0;
  int evaluations = 0;
};

/// Pattern search (Hooke and Jeeves, J. ACM 8, 1961): tries each parameter up and down, repeats moves that
/// help, and halves a parameter's step if neither helps, until all are below `shrink_to` of their initial
/// size or `max_evaluations` is reached. Needs no derivatives, so ruptures and layer changes (which jump) do
/// not stop it; finds only the nearest valley. Deterministic. Costs that are not finite count as infinite.
FitResult patternSearch(const std::function<double(const std::vector<double>&)>& cost,
                        const std::vector<FitParameter>& parameters, int max_evaluations,
                        double shrink_to = 1.0 / 256);

/// One bin of a curve: the mean of its digitised rows.
struct CurveBin {
  double at = 0;       ///< mean depth or time of its rows
  double value = 0;    ///< mean of its rows
  double scatter = 0;  ///< rms of its rows about that mean
  int block = 0;       ///< floor(at / block width)
  std::vector<std::size_t> rows;
};

/// Sorts rows (at, value), ordered by `at`, into bins of `width` that do not straddle blocks of `block_width`
/// (a multiple of `width`). A digitised curve has more rows in steep parts; bins weight all parts equally.
std::vector<CurveBin> binned(const std::vector<double>& at, const std::vector<double>& value, double width,
                             double block_width);

struct CurveError {
  double rms = 0, max = 0;
  double rows_rms = 0;  ///< over single rows instead of bins
  double floor = 0;  ///< RMS of the rows about their bins' means: no function of `at` can do better by rows
  std::size_t bins = 0, rows = 0;
};

/// Error of `model` (its value at each row) over the bins selected by `use`: per bin the mean of model − row.
CurveError curveError(const std::vector<CurveBin>& bins, const std::vector<double>& value,
                      const std::vector<double>& model, const std::function<bool(const CurveBin&)>& use);

/// Depth of the tip below the scene's surface at each tick (negative: outside), in m. The needle points along
/// the motion; the scene's limb must be the plane z = 0 with normal +z.
struct StraightGesture {
  double rate_hz = 1000;
  std::vector<double> depth_m;
};

/// Resisting force at each tick in N: positive pushes the needle out, as in recordings.
struct AxialRun {
  std::vector<double> force_N;
  std::vector<std::uint32_t> flags;  ///< StepFlag of each tick
};

/// Errors: those of `compile`.
Result<AxialRun> runStraight(const SceneSpec& scene, const StraightGesture& gesture);
/// The same with a compiled scene, for many runs. Resizes `run`.
void runStraight(const SceneModel& model, const StraightGesture& gesture, AxialRun& run);

/// From `from_m` to `to_m` at `speed_mps`, the first tick at `from_m`.
StraightGesture constantSpeed(double from_m, double to_m, double speed_mps, double rate_hz);

/// The force at a fractional tick, interpolated linearly, constant beyond both ends.
double forceAtTick(const AxialRun& run, double tick);

/// The base of fitted scenes: a plane at z = 0, no effects, no layers, sum capped at 50 N. Stops below 1
/// mm/s, because recordings move at 3 mm/s, the usual stop speed.
SceneSpec fittedSceneBase();

/// Median time of a single hot tick of a model along `gesture`, minus that of an empty call timed in the same
/// way, in ns.
double hotTickTime_ns(const SceneModel& model, const StraightGesture& gesture);

}  // namespace needlelab
