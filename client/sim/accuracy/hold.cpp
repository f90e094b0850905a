#include "client/sim/accuracy/hold.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "common/base/plausible.h"
#include "common/base/text/csv.h"

namespace needlelab {
namespace {

constexpr double kHoldRate_hz = 1000;
constexpr double kInsertionSpeed_mps = 0.003;
constexpr double kInsertion_s = 1.2;  // 3.6 mm: then the wall is fully stretched
constexpr int kMaxHoldEvaluations = 600;

TimeCurve curveOf(const std::vector<ForceAtTime>& rows, double from_s, double to_s, double bin_s,
                  double block_s) {
  TimeCurve curve;
  for (const ForceAtTime& row : rows) {
    if (row.t_s < from_s || row.t_s > to_s) continue;
    curve.t_s.push_back(row.t_s);
    curve.force_N.push_back(row.force_N);
  }
  curve.bins = binned(curve.t_s, curve.force_N, bin_s, block_s);
  return curve;
}

Error noRows(const char* what, double from_s, double to_s) {
  return Error{ErrorCode::kInvalidInput,
               fmt::format("no rows to fit the {} on between {:f} s and {:f} s", what, from_s, to_s)};
}

// One infinite layer that is cut with `force_N`.
SceneSpec holdScene(double force_N) {
  SceneSpec scene = fittedSceneBase();
  scene.effects = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  scene.layers.push_back({});
  scene.layers[0].thickness_m = 0.1;
  scene.layers[0].cutting_force_N = force_N;
  // a slow withdrawal must end the stop: at twice the stop speed
  scene.tracking_wall.stop_speed_mps = 0.0005;
  scene.tracking_wall.stop_dwell_s = 0.01;
  return scene;
}

SceneSpec sceneOf(const HoldFit& fit) {
  SceneSpec scene = holdScene(fit.force_N);
  TrackingWallSpec& wall = scene.tracking_wall;
  wall.stop_mode = fit.mode;
  if (fit.mode == StopMode::kExponential) {
    wall.relax_time_s = fit.relax_time_s;
    wall.relax_residual = fit.relax_residual;
  } else {
    wall.stop_duration_s = fit.stop_duration_s;
    scene.layers[0].rejection_force_N = std::min(fit.rejection_force_N, fit.force_N);
  }
  return scene;
}

void take(HoldFit& fit, const std::vector<double>& values) {
  fit.force_N = values[0];
  if (fit.mode == StopMode::kExponential) {
    fit.relax_time_s = values[1];
    fit.relax_residual = values[2];
  } else {
    fit.stop_duration_s = values[1];
    fit.rejection_force_N = values[2];
  }
}

// In at 3 mm/s, at rest from kHoldFrom_s until `to_s`.
StraightGesture insertThenHold(double to_s) {
  const auto in = static_cast<std::size_t>(kInsertion_s * kHoldRate_hz);
  StraightGesture gesture{kHoldRate_hz, {}};
  // start outside: an insertion begins with an entry
  for (std::size_t i = 0; i <= in; ++i)
    gesture.depth_m.push_back((static_cast<double>(i) - 0.5) * kInsertionSpeed_mps / kHoldRate_hz);
  const auto all = static_cast<std::size_t>(std::ceil((to_s - kHoldFrom_s) * kHoldRate_hz)) + in + 1;
  gesture.depth_m.resize(std::max(all, gesture.depth_m.size()), gesture.depth_m.back());
  return gesture;
}

}  // namespace

std::vector<double> modelAt(const TimeCurve& curve, const StraightGesture& gesture, const AxialRun& run,
                            double from_s) {
  std::vector<double> model;
  for (const double t_s : curve.t_s) model.push_back(forceAtTime(gesture, run, from_s, t_s));
  return model;
}

Result<std::vector<ForceAtTime>> readForceOverTime(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(const auto table, readCsv(file, {"t_s", "force_n"}, {}, {.max_rows = 1'000'000}));
  const auto& time = table.columns[static_cast<std::size_t>(table.find("t_s"))];
  const auto& force = table.columns[static_cast<std::size_t>(table.find("force_n"))];
  std::vector<ForceAtTime> rows;
  for (std::size_t i = 0; i < time.size(); ++i) rows.push_back({time[i], force[i]});
  const auto greatest = std::ranges::max_element(force, {}, [](double force_N) { return std::abs(force_N); });
  const std::size_t line = table.lines[static_cast<std::size_t>(greatest - force.begin())];
  RETURN_IF_ERROR(
      checkPlausible(fmt::format("{} line {}: force_n", file.string(), line), Quantity::kForce, *greatest));
  std::stable_sort(rows.begin(), rows.end(),
                   [](const ForceAtTime& a, const ForceAtTime& b) { return a.t_s < b.t_s; });
  std::vector<double> times;
  for (const ForceAtTime& row : rows) times.push_back(row.t_s);
  RETURN_IF_ERROR(checkTimeStep(file.string(), times));
  return rows;
}

TimeCurve holdOf(const std::vector<ForceAtTime>& rows) {
  return curveOf(rows, kHoldFrom_s, kHoldTo_s, kHoldBin_s, kHoldBlock_s);
}
TimeCurve withdrawalOf(const std::vector<ForceAtTime>& rows) {
  return curveOf(rows, kHoldTo_s, kWithdrawalTo_s, kWithdrawalBin_s, kWithdrawalBlock_s);
}

double forceAtTime(const StraightGesture& gesture, const AxialRun& run, double from_s, double t_s) {
  return forceAtTick(run, (t_s - from_s) * gesture.rate_hz);
}

Result<HoldFit> fitHold(const std::vector<ForceAtTime>& rows, StopMode mode, const BlockChoice& fit_on) {
  const TimeCurve curve = holdOf(rows);
  const auto fitted = [&](const CurveBin& bin) { return fit_on(bin.block); };
  const auto held_out = [&](const CurveBin& bin) { return !fit_on(bin.block); };
  const auto first = std::find_if(curve.bins.begin(), curve.bins.end(), fitted);
  if (first == curve.bins.end()) return noRows("hold", kHoldFrom_s, kHoldTo_s);

  HoldFit fit;
  fit.mode = mode;
  fit.from_s = kHoldFrom_s - kInsertion_s;
  fit.gesture = insertThenHold(kHoldTo_s);

  const double start_N = std::max(0.01, first->value);
  std::vector<FitParameter> parameters = {{"force_n", start_N, 0.001, 50, 0.05 * start_N}};
  if (mode == StopMode::kExponential) {
    parameters.push_back({"relax_time_s", 1.0, 0.01, 60, 0.5});
    parameters.push_back({"relax_residual", 0.5, 0, 1, 0.2});
  } else {
    parameters.push_back({"stop_duration_s", 4.0, 0.01, 10, 1});
    parameters.push_back({"rejection_force_n", 0.7 * start_N, 0, 50, 0.1 * start_N});
  }

  AxialRun run;
  const auto cost = [&](const std::vector<double>& values) {
    HoldFit tried;
    tried.mode = mode;
    take(tried, values);
    const auto model = compile(sceneOf(tried), kHoldRate_hz);
    if (!model.ok()) return std::numeric_limits<double>::infinity();
    runStraight(*model, fit.gesture, run);
    return curveError(curve.bins, curve.force_N, modelAt(curve, fit.gesture, run, fit.from_s), fitted).rms;
  };
  const FitResult found = patternSearch(cost, parameters, kMaxHoldEvaluations, 1.0 / 1024);
  take(fit, found.values);
  fit.evaluations = found.evaluations;

  fit.scene = sceneOf(fit);
  ASSIGN_OR_RETURN(auto whole, runStraight(fit.scene, fit.gesture));
  fit.run = std::move(whole);
  const auto model = modelAt(curve, fit.gesture, fit.run, fit.from_s);
  fit.fitted = curveError(curve.bins, curve.force_N, model, fitted);
  fit.held_out = curveError(curve.bins, curve.force_N, model, held_out);
  return fit;
}

Result<WithdrawalFit> fitWithdrawal(const std::vector<ForceAtTime>& rows, const HoldFit& hold,
                                    const BlockChoice& fit_on) {
  const TimeCurve curve = withdrawalOf(rows);
  const auto fitted = [&](const CurveBin& bin) { return fit_on(bin.block); };
  const auto held_out = [&](const CurveBin& bin) { return !fit_on(bin.block); };
  if (std::none_of(curve.bins.begin(), curve.bins.end(), fitted))
    return noRows("withdrawal", kHoldTo_s, kWithdrawalTo_s);

  WithdrawalFit fit;
  const auto gestureOf = [&](double speed_mps, double depth_m) {
    // the same hold at this depth: the insertion before it starts further out
    StraightGesture gesture = insertThenHold(kHoldTo_s);
    const double shift_m = depth_m - gesture.depth_m.back();
    for (double& d : gesture.depth_m) d += shift_m;
    // beyond 3.6 mm the first tick must still be outside
    std::vector<double> before;
    for (double d = gesture.depth_m.front(); d > 0; d -= kInsertionSpeed_mps / kHoldRate_hz)
      before.push_back(d - kInsertionSpeed_mps / kHoldRate_hz);
    gesture.depth_m.insert(gesture.depth_m.begin(), before.rbegin(), before.rend());
    fit.from_s = kHoldFrom_s - kInsertion_s - static_cast<double>(before.size()) / kHoldRate_hz;
    const auto out = static_cast<std::size_t>((kWithdrawalTo_s - kHoldTo_s) * kHoldRate_hz);
    for (std::size_t i = 0; i < out; ++i)
      gesture.depth_m.push_back(gesture.depth_m.back() - speed_mps / kHoldRate_hz);
    return gesture;
  };
  const auto sceneWith = [&](double attracted_N) {
    SceneSpec scene = hold.scene;
    scene.layers[0].attracted_force_N = attracted_N;
    scene.layers[0].rejection_force_N = std::min(scene.layers[0].rejection_force_N, attracted_N);
    return scene;
  };

  AxialRun run;
  const auto cost = [&](const std::vector<double>& values) {
    const auto model = compile(sceneWith(values[2]), kHoldRate_hz);
    if (!model.ok()) return std::numeric_limits<double>::infinity();
    const StraightGesture gesture = gestureOf(values[0], values[1]);
    runStraight(*model, gesture, run);
    return curveError(curve.bins, curve.force_N, modelAt(curve, gesture, run, fit.from_s), fitted).rms;
  };
  const FitResult found = patternSearch(cost,
                                        {{"speed_mps", 0.003, 0.0011, 0.05, 0.001},
                                         {"depth_m", 0.003, 0.0012, 0.02, 0.001},
                                         {"attracted_n", 0.1, 0, 1, 0.03}},
                                        kMaxHoldEvaluations);
  fit.speed_mps = found.values[0];
  fit.depth_m = found.values[1];
  fit.attracted_force_N = found.values[2];
  fit.gesture = gestureOf(fit.speed_mps, fit.depth_m);
  ASSIGN_OR_RETURN(auto whole, runStraight(sceneWith(fit.attracted_force_N), fit.gesture));
  fit.run = std::move(whole);
  const auto model = modelAt(curve, fit.gesture, fit.run, fit.from_s);
  fit.fitted = curveError(curve.bins, curve.force_N, model, fitted);
  fit.held_out = curveError(curve.bins, curve.force_N, model, held_out);
  return fit;
}

}  // namespace needlelab
