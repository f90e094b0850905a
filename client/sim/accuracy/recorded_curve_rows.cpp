/// Rows of the force-depth curve: each model's error on what it was not fitted on.
#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded_curve.h"
#include "client/sim/accuracy/recorded_rows.h"
#include "client/sim/accuracy/recorded_spread.h"
#include "client/sim/accuracy/recorded_text.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr const char* kScene = "bovine_liver_heart_18g";
constexpr const char* kCannotShow =
    "one insertion of one needle into one animal's organs: nothing about other tissues, needles or speeds, "
    "about the "
    "withdrawal, or about what a hand feels";

constexpr const char* kAlternate =
    "recorded force over depth; fitted on every second block of 0.5 mm, error on the blocks held out (both "
    "halves in "
    "turn)";

// the fitted scene as it runs: time of a tick, greatest step, and its error's share that can be felt
std::string addRun(const CurveFit& fit, double to_m, AccuracyRow& row) {
  const auto run = runCurve(fit.scene, to_m);
  const auto model = compile(fit.scene.spec, 1000);
  if (!run.ok() || !model.ok()) return "";
  addGreatestStep(run->run, row);
  row.noticeable_n = noticeableForce_N(*std::max_element(run->run.force_N.begin(), run->run.force_N.end()));
  return "; " + addTickTime(*model, run->gesture, row);
}

AccuracyRow rowOf(const CurveFit& fit) {
  AccuracyRow row;
  row.scene = kScene;
  row.model = axialModelName(fit.model);
  row.variant = fit.variant + ", " + std::to_string(fit.parameters) + " numbers fitted";
  row.cannot_show = kCannotShow;
  return row;
}

// both halves held out in turn: every bin counts once
AccuracyRow alternateRow(const CurveFit& a, const CurveFit& b, const DepthCurve& curve) {
  AccuracyRow row = rowOf(a);
  row.reference = kAlternate;
  const auto na = static_cast<double>(a.held_out.bins), nb = static_cast<double>(b.held_out.bins);
  row.rms_error_n =
      std::sqrt((a.held_out.rms * a.held_out.rms * na + b.held_out.rms * b.held_out.rms * nb) / (na + nb));
  row.max_error_n = std::max(a.held_out.max, b.held_out.max);
  row.rms_error_spread_n = std::fabs(a.held_out.rms - b.held_out.rms) / std::sqrt(2.0);
  const std::string time = addRun(a, curve.depth_m.back(), row);
  row.uncertainty = formatted(
      "%zu bins of 0.25 mm held out; error on the fitted halves %.3f and %.3f N, on the held-out ones %.3f "
      "and %.3f N; "
      "rows scatter %.2f N (rms) about their bin's mean, nearly all of it in the falls at ruptures",
      a.held_out.bins + b.held_out.bins, a.fitted.rms, b.fitted.rms, a.held_out.rms, b.held_out.rms,
      std::max(a.held_out.floor, b.held_out.floor));
  row.uncertainty += time;
  return row;
}

// STATISTICAL with the fitted tables as its means: the error is that of one insertion, as a trainee meets it
Result<AccuracyRow> statisticalRow(const std::vector<CurveFit>& tables, const DepthCurve& curve,
                                   int insertions) {
  std::vector<SpreadCheck> checks;
  for (int fold = 0; fold < 2; ++fold) {
    const BinChoice choice = alternateBlocks(fold);
    auto check = checkSpread(curve, spreadAround(curve, tables[static_cast<std::size_t>(fold)], choice),
                             choice, insertions);
    if (!check.ok()) return check.error();
    checks.push_back(std::move(check).value());
  }
  AccuracyRow row;
  row.scene = kScene;
  row.model = axialModelName(AxialModel::kStatistical);
  row.variant =
      formatted("mean and sd of %zu rows, 1 mm apart", checks[0].scene.spec.statistical.table.size());
  row.reference = kAlternate;
  row.rms_error_n = 0.5 * (checks[0].held_out_rms + checks[1].held_out_rms);
  row.max_error_n = std::max(checks[0].held_out_max, checks[1].held_out_max);
  row.rms_error_spread_n = 0.5 * (checks[0].spread_of_rms + checks[1].spread_of_rms);
  row.cannot_show =
      "one insertion: how patients differ is not in it; the spread is that of digitised rows about the "
      "table, the "
      "correlation length is synthetic";
  const auto run = runCurve(checks[0].scene, curve.depth_m.back());
  const auto model = compile(checks[0].scene.spec, 1000);
  if (!run.ok()) return run.error();
  if (!model.ok()) return model.error();
  addGreatestStep(run->run, row);
  row.noticeable_n = noticeableForce_N(*std::max_element(run->run.force_N.begin(), run->run.force_N.end()));
  row.uncertainty = formatted(
      "error of one insertion, mean of %d per half; the mean of all insertions is off by %.3f and %.3f N; "
      "%.0f %% and "
      "%.0f %% of the rows held out after the contact lie within the 95 %% band; ",
      insertions, checks[0].held_out_of_mean.rms, checks[1].held_out_of_mean.rms, 100 * checks[0].in_band,
      100 * checks[1].in_band);
  row.uncertainty += addTickTime(*model, run->gesture, row);
  return row;
}

// what a model that knows nothing has there: the last force before the split, held
double errorOfHolding(const DepthCurve& curve) {
  const auto fitted = chosenBins(curve, beforeTheSplit());
  const std::vector<double> held_N(curve.depth_m.size(), fitted.back().value);
  return curveError(curve.bins, curve.force_N, held_N,
                    [](const CurveBin& bin) { return !beforeTheSplit()(bin); })
      .rms;
}

AccuracyRow extrapolationRow(const CurveFit& fit, const DepthCurve& curve) {
  AccuracyRow row = rowOf(fit);
  row.reference =
      "recorded force over depth; fitted on the first 25 mm, error on the rest (extrapolation past three "
      "ruptures)";
  row.advises = false;  // which model happens to be least wrong ahead of its data says nothing of models
  row.rms_error_n = fit.held_out.rms;
  row.max_error_n = fit.held_out.max;
  const std::string time = addRun(fit, curve.depth_m.back(), row);
  row.uncertainty = formatted(
      "%zu bins of 0.25 mm held out; error on the fitted part %.3f N; holding the force at 25 mm to the end "
      "is off by "
      "%.3f N: no model of one insertion knows of what lies ahead",
      fit.held_out.bins, fit.fitted.rms, errorOfHolding(curve));
  row.uncertainty += time;
  return row;
}

}  // namespace

Result<AccuracyRows> recordedCurveRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                       std::vector<std::string>& notes) {
  if (!hasRecording(options.data, kLiverHeartFile)) {
    notes.push_back(missingRecording(options.data, kLiverHeartFile));
    return AccuracyRows{};
  }
  int backward = 0;
  const auto recorded = readForceOverDepth(options.data / kLiverHeartFile, &backward);
  if (!recorded.ok()) return recorded.error();
  const DepthCurve curve = depthCurve(*recorded);
  notes.push_back(
      formatted("%s: digitised in several passes (%d steps back in depth): sorted by depth, means over 0.25 "
                "mm; falls within one bin are between the needle's force before and after",
                kScene, backward));

  // the same models for each choice of what to fit on
  const std::vector<BinChoice> choices = {alternateBlocks(0), alternateBlocks(1), beforeTheSplit()};
  std::vector<std::vector<CurveModel>> models;
  for (const BinChoice& choice : choices) models.push_back(curveModels(chosenBins(curve, choice)));
  AccuracyRows alternate, extrapolated;
  for (std::size_t m = 0; m < models.front().size(); ++m) {
    std::vector<CurveFit> fits;
    for (std::size_t c = 0; c < choices.size(); ++c) {
      if (progress)
        progress("fitting " + std::string(axialModelName(models[c][m].model)) + " to " + kScene,
                 (static_cast<double>(m) + static_cast<double>(c) / 3) /
                     static_cast<double>(models.front().size()));
      auto fit = fitCurve(curve, models[c][m], choices[c]);
      if (!fit.ok()) return fit.error();
      fits.push_back(std::move(fit).value());
    }
    if (fits[0].model == AxialModel::kPrecomputed) {
      auto row = statisticalRow(fits, curve, options.long_form ? 1000 : 100);
      if (!row.ok()) return row.error();
      alternate.push_back(std::move(row).value());
    }
    alternate.push_back(alternateRow(fits[0], fits[1], curve));
    extrapolated.push_back(extrapolationRow(fits[2], curve));
  }
  AccuracyRows rows = std::move(alternate);
  rows.insert(rows.end(), extrapolated.begin(), extrapolated.end());
  return rows;
}

}  // namespace needlelab
