#include "client/sim/accuracy/recorded_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "client/sim/accuracy/recorded_fit.h"
#include "client/sim/accuracy/recorded_statistical.h"

namespace needlelab {
namespace {

constexpr double kFitRate_hz = 100;  // 30 µm per tick, an eighth of a bin; the result is run at 1 kHz
constexpr int kMostEvaluations = 4000, kRestarts = 8;

StraightGesture gestureTo(double surface_m, double to_m, double rate_hz, double speed_mps) {
  // the first tick is outside: an insertion begins with an entry
  const double step_m = speed_mps / rate_hz;
  return constantSpeed(-0.5 * step_m, std::max(to_m - surface_m, step_m), speed_mps, rate_hz);
}

Error noRows() {
  return {ErrorCode::kInvalidInput, "no rows of the force-depth curve to fit on"};
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

Result<BaselineFit> fitBaseline(const DepthCurve& curve, Baseline baseline, const BinChoice& fit_on,
                                std::size_t most_numbers) {
  const std::vector<CurveBin> through = thinned(chosenBins(curve, fit_on), most_numbers);
  if (through.empty()) return noRows();
  std::vector<double> force_N;
  for (const double d : curve.depth_m) force_N.push_back(baselineAt(baseline, through, d));
  return BaselineFit{
      baseline, through.size(), curveError(curve.bins, curve.force_N, force_N, fit_on),
      curveError(curve.bins, curve.force_N, force_N, [&](const CurveBin& bin) { return !fit_on(bin); })};
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
  FitResult found = patternSearch(cost, parameters, kMostEvaluations);
  for (int again = 0; again < kRestarts; ++again) {
    auto from = parameters;
    for (std::size_t i = 0; i < from.size(); ++i) from[i].start = found.values[i];
    FitResult next = patternSearch(cost, from, kMostEvaluations);
    next.evaluations += found.evaluations;
    const bool better = next.cost < 0.999 * found.cost;
    found = std::move(next);
    if (!better) break;
  }
  return found;
}

Result<CurveFit> fitCurve(const DepthCurve& curve, const CurveModel& model, const BinChoice& fit_on) {
  if (std::none_of(curve.bins.begin(), curve.bins.end(), fit_on)) return noRows();
  const double to_m = curve.depth_m.back();
  const auto cost = [&](const std::vector<double>& values) {
    const CurveScene scene = model.scene(values);
    const auto run = runCurve(scene, to_m, kFitRate_hz);
    if (!run.ok()) return std::numeric_limits<double>::infinity();
    return curveError(curve.bins, curve.force_N, forceAtDepths(*run, scene.surface_m, curve.depth_m), fit_on)
        .rms;
  };
  const FitResult found = searchAgain(cost, model.parameters);

  CurveFit fit{
      model.model, model.variant,    model.numbers(), found.values, model.scene(found.values), {}, {},
      {},          found.evaluations};
  ASSIGN_OR_RETURN(const auto run, runCurve(fit.scene, to_m));
  fit.model_N = forceAtDepths(run, fit.scene.surface_m, curve.depth_m);
  fit.fitted = curveError(curve.bins, curve.force_N, fit.model_N, fit_on);
  fit.held_out =
      curveError(curve.bins, curve.force_N, fit.model_N, [&](const CurveBin& bin) { return !fit_on(bin); });
  return fit;
}

StatisticalSpec spreadAround(const DepthCurve& curve, const CurveFit& table, const BinChoice& fit_on) {
  constexpr double kReach_m = 0.001, kLeast_N = 0.005;
  StatisticalSpec spec;
  spec.seed = 1;
  for (const auto& row : table.scene.spec.precomputed.table) {
    double squares = 0;
    std::size_t count = 0;
    for (const CurveBin& bin : curve.bins) {
      if (!fit_on(bin) || std::fabs(bin.at - row.depth_m) > kReach_m) continue;
      for (const std::size_t i : bin.rows) {
        squares += std::pow(curve.force_N[i] - table.model_N[i], 2);
        ++count;
      }
    }
    const double mean_N = std::max(kLeast_N, row.cutting_N);
    const double sd_N = count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
    // more spread than the mean would only give a log-normal law a heavier tail
    spec.table.push_back({row.depth_m, mean_N, std::clamp(sd_N, kLeast_N, mean_N)});
  }
  return spec;
}

Result<SpreadCheck> checkSpread(const DepthCurve& curve, const StatisticalSpec& spec, const BinChoice& fit_on,
                                int insertions) {
  const auto held_out = [&](const CurveBin& bin) { return !fit_on(bin); };
  SpreadCheck check;
  check.scene.spec = fittedSceneBase();
  check.scene.spec.axial_model = AxialModel::kStatistical;
  check.scene.spec.effects = bitOf(Effect::kCutting);
  check.scene.spec.tracking_wall.stiffness_N_per_m = 1000;
  check.scene.spec.layers.push_back({});
  check.scene.spec.layers[0].thickness_m = 0.1;
  check.scene.spec.statistical = spec;

  std::vector<double> mean_N(curve.depth_m.size(), 0), rms;
  for (int i = 0; i < insertions; ++i) {
    CurveScene scene = check.scene;
    scene.spec.statistical.seed = spec.seed + static_cast<std::uint64_t>(i);
    ASSIGN_OR_RETURN(const auto run, runCurve(scene, curve.depth_m.back()));
    const auto force_N = forceAtDepths(run, scene.surface_m, curve.depth_m);
    const CurveError error = curveError(curve.bins, curve.force_N, force_N, held_out);
    rms.push_back(error.rms);
    check.held_out_rms += error.rms / insertions;
    check.held_out_max = std::max(check.held_out_max, error.max);
    for (std::size_t k = 0; k < mean_N.size(); ++k) mean_N[k] += force_N[k] / insertions;
  }
  for (const double one : rms) check.spread_of_rms += std::pow(one - check.held_out_rms, 2) / insertions;
  check.spread_of_rms = std::sqrt(check.spread_of_rms);
  check.held_out_of_mean = curveError(curve.bins, curve.force_N, mean_N, held_out);

  // before the contact the digitised noise is symmetric about zero; a log-normal force is not
  constexpr double kFelt_N = 0.02;
  std::size_t rows = 0, inside = 0;
  std::set<int> blocks;
  for (const CurveBin& bin : curve.bins) {
    if (!held_out(bin)) continue;
    for (const std::size_t i : bin.rows) {
      const ForceLaw law = forceLawAt(spec, curve.depth_m[i]);
      if (law.mean_N < kFelt_N) continue;
      const ForceBand band = centralBand95(law.mean_N, law.sd_N);
      ++rows;
      blocks.insert(bin.block);
      if (curve.force_N[i] >= band.low_N && curve.force_N[i] <= band.high_N) ++inside;
    }
  }
  check.in_band = rows > 0 ? static_cast<double>(inside) / static_cast<double>(rows) : 0;
  check.blocks = blocks.size();
  return check;
}

}  // namespace needlelab
