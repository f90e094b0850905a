#include "client/sim/accuracy/recorded_hold.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "client/sim/accuracy/recorded.h"
#include "client/sim/accuracy/recorded_fit.h"

namespace needlelab {
namespace {

constexpr double kHoldRate_hz = 1000;
constexpr double kInsertionSpeed_mps = 0.003;
constexpr double kInsertion_s = 1.2;  // 3.6 mm: the wall is stretched fully by then
constexpr int kMostHoldEvaluations = 600;

struct Curve {
  std::vector<double> t_s, force_N;
  std::vector<CurveBin> bins;
};

Curve curveOf(const std::vector<ForceAtTime>& rows, double from_s, double to_s, double bin_s,
              double block_s) {
  Curve curve;
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

// one layer without end that is cut with `force_N`
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

std::vector<double> modelAt(const Curve& curve, const StraightGesture& gesture, const AxialRun& run,
                            double from_s) {
  std::vector<double> model;
  for (const double t_s : curve.t_s) model.push_back(forceAtTime(gesture, run, from_s, t_s));
  return model;
}

// in at 3 mm/s, at rest at kHoldFrom_s, until `to_s`
StraightGesture insertThenHold(double to_s) {
  const auto in = static_cast<std::size_t>(kInsertion_s * kHoldRate_hz);
  StraightGesture gesture{kHoldRate_hz, {}};
  // the first tick is outside: an insertion begins with an entry
  for (std::size_t i = 0; i <= in; ++i)
    gesture.depth_m.push_back((static_cast<double>(i) - 0.5) * kInsertionSpeed_mps / kHoldRate_hz);
  const auto all = static_cast<std::size_t>(std::ceil((to_s - kHoldFrom_s) * kHoldRate_hz)) + in + 1;
  gesture.depth_m.resize(std::max(all, gesture.depth_m.size()), gesture.depth_m.back());
  return gesture;
}

}  // namespace

double forceAtTime(const StraightGesture& gesture, const AxialRun& run, double from_s, double t_s) {
  return forceAtTick(run, (t_s - from_s) * gesture.rate_hz);
}

Result<HoldFit> fitHold(const std::vector<ForceAtTime>& rows, StopMode mode, const BlockChoice& fit_on) {
  const Curve curve = curveOf(rows, kHoldFrom_s, kHoldTo_s, kHoldBin_s, kHoldBlock_s);
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
  const FitResult found = patternSearch(cost, parameters, kMostHoldEvaluations, 1.0 / 1024);
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

Result<WithdrawalFit> fitWithdrawal(const std::vector<ForceAtTime>& rows, const HoldFit& hold) {
  const Curve curve = curveOf(rows, kHoldTo_s, kWithdrawalTo_s, kWithdrawalBin_s, kWithdrawalBlock_s);
  const auto fitted = [](const CurveBin& bin) { return bin.block % 2 == 0; };
  const auto held_out = [](const CurveBin& bin) { return bin.block % 2 != 0; };
  if (std::none_of(curve.bins.begin(), curve.bins.end(), fitted))
    return noRows("withdrawal", kHoldTo_s, kWithdrawalTo_s);

  WithdrawalFit fit;
  const auto gestureOf = [&](double speed_mps, double depth_m) {
    // the hold as it was, but at this depth: the insertion just before it starts further out
    StraightGesture gesture = insertThenHold(kHoldTo_s);
    const double shift_m = depth_m - gesture.depth_m.back();
    for (double& d : gesture.depth_m) d += shift_m;
    // with more depth than 3.6 mm the first tick must still be outside
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
                                        kMostHoldEvaluations);
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

namespace {

constexpr const char* kHoldScene = "insert_hold_withdraw";

struct HoldChoice {
  const char* text;
  BlockChoice fit_on;
  bool extrapolates;
};
const std::vector<HoldChoice>& holdChoices() {
  // blocks of 0.5 s are counted from 0 s: the hold from 2.2 s to 9.85 s has the blocks 4 to 19
  static const std::vector<HoldChoice> choices = {
      {"even blocks of 0.5 s", [](int block) { return block % 2 != 0; }, false},
      {"odd blocks of 0.5 s", [](int block) { return block % 2 == 0; }, false},
      {"all from 5 s on (extrapolation)", [](int block) { return block < 10; }, true}};
  return choices;
}

AccuracyRow holdRow(const HoldFit& fit, const HoldChoice& choice) {
  const bool exponential = fit.mode == StopMode::kExponential;
  AccuracyRow row;
  row.scene = kHoldScene;
  row.model = axialModelName(AxialModel::kEnhancedTrackingWall);
  row.variant =
      exponential ? fmt::format("stop EXPONENTIAL, relax_time {:.2f} s, relax_residual {:.3f}, from {:.3f} N",
                                fit.relax_time_s, fit.relax_residual, fit.force_N)
                  : fmt::format("stop RAMP, over {:.2f} s from {:.3f} N to {:.3f} N", fit.stop_duration_s,
                                fit.force_N, fit.rejection_force_N);
  row.reference = std::string("recorded force over the hold (2.2 s to 9.85 s); held out: ") + choice.text;
  row.rms_error_n = fit.held_out.rms;
  row.max_error_n = fit.held_out.max;
  row.noticeable_n = noticeableForce_N(fit.force_N);
  AxialRun hold;
  const auto from = static_cast<std::ptrdiff_t>((kHoldFrom_s - fit.from_s) * fit.gesture.rate_hz);
  hold.force_N.assign(fit.run.force_N.begin() + from, fit.run.force_N.end());
  hold.flags.assign(fit.run.flags.begin() + from, fit.run.flags.end());
  addGreatestStep(hold, row);
  row.uncertainty = fmt::format(
      "{} means over 0.1 s held out; error on the fitted part {:.4f} N; by single rows {:.4f} N, of which "
      "{:.4f} N is their scatter about those means (a noisy line, digitised)",
      fit.held_out.bins, fit.fitted.rms, fit.held_out.rows_rms, fit.held_out.floor);
  if (const auto model = compile(fit.scene, fit.gesture.rate_hz); model.ok())
    row.uncertainty += "; " + addTickTime(*model, fit.gesture, row);
  row.cannot_show =
      "one hold at one depth in one specimen: nothing about how residual and time depend on tissue, depth or "
      "speed "
      "before the stop";
  return row;
}

AccuracyRow withdrawalRow(const WithdrawalFit& fit, const HoldFit& hold) {
  AccuracyRow row;
  row.scene = kHoldScene;
  row.model = axialModelName(AxialModel::kEnhancedTrackingWall);
  row.variant = fmt::format("attracted force {:.3f} N; the force turns at {:.2f} N/s", fit.attracted_force_N,
                            fit.speed_mps * 500);
  row.reference = "recorded force over the withdrawal (9.85 s to 11.5 s); held out: odd blocks of 0.1 s";
  row.rms_error_n = fit.held_out.rms;
  row.max_error_n = fit.held_out.max;
  row.noticeable_n = noticeableForce_N(hold.force_N);
  row.uncertainty =
      fmt::format("{} means over 0.05 s held out; error on the fitted part {:.4f} N; by single rows {:.4f} N",
                  fit.held_out.bins, fit.fitted.rms, fit.held_out.rows_rms);
  row.cannot_show =
      "the recording has no displacement: wall stiffness and speed act as one product, attracted force and "
      "inserted "
      "depth cannot be told apart from a slow needle, and the peak of 0.147 N may as well be a place as a "
      "force";
  return row;
}

}  // namespace

Result<AccuracyRows> recordedHoldRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes) {
  if (!hasRecording(options.data, kHoldFile)) {
    notes.push_back(missingRecording(options.data, kHoldFile));
    return AccuracyRows{};
  }
  ASSIGN_OR_RETURN(const auto recorded, readForceOverTime(options.data / kHoldFile));
  AccuracyRows rows;
  double done = 0;
  for (const HoldChoice& choice : holdChoices()) {
    for (const StopMode mode : {StopMode::kExponential, StopMode::kRamp}) {
      if (progress) progress("fitting the hold's relaxation", done / 7);
      done += 1;
      ASSIGN_OR_RETURN(const auto fit, fitHold(recorded, mode, choice.fit_on));
      rows.push_back(holdRow(fit, choice));
    }
  }
  if (progress) progress("fitting the withdrawal", done / 7);
  const auto hold = fitHold(recorded, StopMode::kExponential, [](int) { return true; });
  if (!hold.ok()) return hold.error();
  ASSIGN_OR_RETURN(const auto withdrawal, fitWithdrawal(recorded, *hold));
  rows.push_back(withdrawalRow(withdrawal, *hold));
  return rows;
}

namespace {

// the engine's force at 100 Hz of the recording's time
struct OverTime {
  std::vector<double> t_s, force_N;
};
OverTime sampled(const StraightGesture& gesture, const AxialRun& run, double run_from_s, double from_s,
                 double to_s) {
  OverTime out;
  for (double t = from_s; t <= to_s; t += 0.01) {
    out.t_s.push_back(t);
    out.force_N.push_back(forceAtTime(gesture, run, run_from_s, t));
  }
  return out;
}

}  // namespace

Result<RecordedPicture> recordedHoldPicture(const AccuracyOptions& options) {
  ASSIGN_OR_RETURN(const auto rows, readForceOverTime(options.data / kHoldFile));
  const auto even = [](int block) { return block % 2 == 0; };
  ASSIGN_OR_RETURN(const auto exponential, fitHold(rows, StopMode::kExponential, even));
  ASSIGN_OR_RETURN(const auto ramp, fitHold(rows, StopMode::kRamp, even));
  ASSIGN_OR_RETURN(const auto out, fitWithdrawal(rows, exponential));

  std::vector<double> t, f;
  for (const ForceAtTime& row : rows) {
    t.push_back(row.t_s);
    f.push_back(row.force_N);
  }
  std::vector<double> mean_t, mean_f;
  for (const CurveBin& bin : binned(t, f, kHoldBin_s, kHoldBlock_s))
    if (bin.at >= kHoldFrom_s && bin.at <= kHoldTo_s) {
      mean_t.push_back(bin.at);
      mean_f.push_back(bin.value);
    }
  const OverTime e =
      sampled(exponential.gesture, exponential.run, exponential.from_s, kHoldFrom_s, kHoldTo_s);
  const OverTime r = sampled(ramp.gesture, ramp.run, ramp.from_s, kHoldFrom_s, kHoldTo_s);
  const OverTime w = sampled(out.gesture, out.run, out.from_s, kHoldTo_s, kWithdrawalTo_s);
  std::vector<double> held_from, held_to;
  for (int block = 5; block * kHoldBlock_s < kHoldTo_s; block += 2) {
    held_from.push_back(block * kHoldBlock_s);
    held_to.push_back(std::min(kHoldTo_s, (block + 1) * kHoldBlock_s));
  }
  PlotBlocks data;
  data.columns("recorded", {t, f});
  data.columns("means", {mean_t, mean_f});
  data.columns("exponential", {e.t_s, e.force_N});
  data.columns("ramp", {r.t_s, r.force_N});
  data.columns("withdrawal", {w.t_s, w.force_N});
  const std::vector<std::string> legend = {
      fmt::format("EXPONENTIAL: {:.1f} s, {:.2f} of the force stays; error {:.4f} N",
                  exponential.relax_time_s, exponential.relax_residual, exponential.held_out.rms),
      fmt::format("RAMP over {:.1f} s; error {:.4f} N", ramp.stop_duration_s, ramp.held_out.rms),
      fmt::format(
          "withdrawal with one attracted force of {:.3f} N: error {:.3f} N; its displacement is unknown",
          out.attracted_force_N, out.held_out.rms)};
  return RecordedPicture{
      "recorded_hold",
      csvOf({{"t_s", e.t_s}, {"exponential_n", e.force_N}, {"ramp_n", r.force_N}}),
      data.text(),
      {{"finding",
        fmt::format("An exponential stop follows a recorded hold to {:.3f} N, the linear ramp to {:.3f} N",
                    exponential.held_out.rms, ramp.held_out.rms)},
       {"legend", legend},
       {"held_from_s", held_from},
       {"held_to_s", held_to}}};
}

}  // namespace needlelab
