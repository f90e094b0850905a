#include "client/sim/accuracy/recorded_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace needlelab {
namespace {

constexpr double kFitRate_hz = 100;  // 30 µm per tick, an eighth of a bin; the result is run at 1 kHz
constexpr int kMostEvaluations = 4000, kRestarts = 8;

StraightGesture gestureTo(double surface_m, double to_m, double rate_hz) {
  // the first tick is outside: an insertion begins with an entry
  const double step_m = kRecordedSpeed_mps / rate_hz;
  return constantSpeed(-0.5 * step_m, std::max(to_m - surface_m, step_m), kRecordedSpeed_mps, rate_hz);
}

}  // namespace

DepthCurve depthCurve(const std::vector<ForceAtDepth>& rows) {
  DepthCurve curve;
  for (const ForceAtDepth& row : rows) {
    curve.depth_m.push_back(row.depth_m);
    curve.force_N.push_back(row.force_N);
  }
  curve.bins = binned(curve.depth_m, curve.force_N, kDepthBin_m, kDepthBlock_m);
  return curve;
}

BinChoice alternateBlocks(int fold) {
  return [fold](const CurveBin& bin) { return std::abs(bin.block) % 2 != fold; };
}

BinChoice beforeTheSplit() {
  return [](const CurveBin& bin) { return bin.at < kExtrapolateFrom_m; };
}

std::vector<CurveBin> chosenBins(const DepthCurve& curve, const BinChoice& fit_on) {
  std::vector<CurveBin> chosen;
  std::copy_if(curve.bins.begin(), curve.bins.end(), std::back_inserter(chosen), fit_on);
  return chosen;
}

Result<CurveRun> runCurve(const CurveScene& scene, double to_m, double rate_hz) {
  CurveRun made{gestureTo(scene.surface_m, to_m, rate_hz), {}};
  auto run = runStraight(scene.spec, made.gesture);
  if (!run.ok()) return run.error();
  made.run = std::move(run).value();
  return made;
}

std::vector<double> forceAtDepths(const CurveRun& run, double surface_m, const std::vector<double>& depth_m) {
  const double first_m = run.gesture.depth_m.front();
  const double step_m = run.gesture.depth_m.size() > 1 ? run.gesture.depth_m[1] - first_m : 1;
  std::vector<double> force_N;
  force_N.reserve(depth_m.size());
  for (const double d : depth_m) force_N.push_back(forceAtTick(run.run, (d - surface_m - first_m) / step_m));
  return force_N;
}

Result<CurveFit> fitCurve(const DepthCurve& curve, const CurveModel& model, const BinChoice& fit_on) {
  if (std::none_of(curve.bins.begin(), curve.bins.end(), fit_on))
    return Error{ErrorCode::kInvalidInput, "no rows of the force-depth curve to fit on"};
  const double to_m = curve.depth_m.back();
  const auto cost = [&](const std::vector<double>& values) {
    const CurveScene scene = model.scene(values);
    const auto run = runCurve(scene, to_m, kFitRate_hz);
    if (!run.ok()) return std::numeric_limits<double>::infinity();
    return curveError(curve.bins, curve.force_N, forceAtDepths(*run, scene.surface_m, curve.depth_m), fit_on)
        .rms;
  };
  // again from where it ended, with full steps: ruptures make many small valleys
  FitResult found = patternSearch(cost, model.parameters, kMostEvaluations);
  for (int again = 0; again < kRestarts; ++again) {
    auto parameters = model.parameters;
    for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i].start = found.values[i];
    FitResult next = patternSearch(cost, parameters, kMostEvaluations);
    next.evaluations += found.evaluations;
    const bool better = next.cost < 0.999 * found.cost;
    found = std::move(next);
    if (!better) break;
  }

  CurveFit fit{
      model.model, model.variant,    model.parameters.size(), found.values, model.scene(found.values), {}, {},
      {},          found.evaluations};
  const auto run = runCurve(fit.scene, to_m);
  if (!run.ok()) return run.error();
  fit.model_N = forceAtDepths(*run, fit.scene.surface_m, curve.depth_m);
  fit.fitted = curveError(curve.bins, curve.force_N, fit.model_N, fit_on);
  fit.held_out =
      curveError(curve.bins, curve.force_N, fit.model_N, [&](const CurveBin& bin) { return !fit_on(bin); });
  return fit;
}

}  // namespace needlelab
