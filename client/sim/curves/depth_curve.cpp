#include "client/sim/curves/depth_curve.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>

namespace needlelab {
namespace {

constexpr int kMaxEvaluations = 4000, kRestarts = 8;

StraightGesture gestureTo(double surface_m, double to_m, double rate_hz, double speed_mps) {
  // start outside: an insertion begins with an entry
  const double step_m = speed_mps / rate_hz;
  return constantSpeed(-0.5 * step_m, std::max(to_m - surface_m, step_m), speed_mps, rate_hz);
}

}  // namespace

BinChoice alternateBlocks(int fold) {
  return [fold](const CurveBin& bin) { return std::abs(bin.block) % 2 != fold; };
}

Result<CurveRun> runCurve(const CurveScene& scene, double to_m, double rate_hz, double speed_mps) {
  CurveRun made{gestureTo(scene.surface_m, to_m, rate_hz, speed_mps), {}};
  ASSIGN_OR_RETURN(auto run, runStraight(scene.spec, made.gesture));
  made.run = std::move(run);
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

FitResult searchAgain(const std::function<double(const std::vector<double>&)>& cost,
                      const std::vector<FitParameter>& parameters) {
  FitResult found = patternSearch(cost, parameters, kMaxEvaluations);
  for (int again = 0; again < kRestarts; ++again) {
    auto from = parameters;
    for (std::size_t i = 0; i < from.size(); ++i) from[i].start = found.values[i];
    FitResult next = patternSearch(cost, from, kMaxEvaluations);
    next.evaluations += found.evaluations;
    const bool better = next.cost < 0.999 * found.cost;
    found = std::move(next);
    if (!better) break;
  }
  return found;
}

}  // namespace needlelab
