/// The recorded force-depth curve in the report: its rows and its two pictures.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/sim/accuracy/recorded.h"
#include "client/sim/accuracy/recorded_curve.h"
#include "client/sim/accuracy/recorded_statistical.h"

namespace needlelab {
namespace {

constexpr const char* kCurveScene = "bovine_liver_heart_18g";
constexpr const char* kCannotShow =
    "one insertion of one needle into one animal's organs: nothing about other tissues, needles or speeds, "
    "about the "
    "withdrawal, or about what a hand feels";

constexpr const char* kAlternate =
    "recorded force over depth; fitted on every second block of 0.5 mm, error on the blocks held out (both "
    "halves in turn): interpolation";
constexpr const char* kEqual =
    "recorded force over depth; fitted on every second block of 0.5 mm, error on the blocks held out (both "
    "halves in turn): interpolation with at most 20 numbers each";
constexpr const char* kExtrapolation =
    "recorded force over depth; fitted on the first 25 mm, error on the rest (extrapolation past three "
    "ruptures)";

// the fitted scene at run time: greatest step, the noticeable share of its error, and the time of a tick
// (once for a model: fewer numbers or another part of the curve cost the same)
std::string addRun(const CurveFit& fit, double to_m, bool timed, AccuracyRow& row) {
  const auto run = runCurve(fit.scene, to_m);
  const auto model = compile(fit.scene.spec, 1000);
  if (!run.ok() || !model.ok()) return "";
  addGreatestStep(run->run, row);
  row.noticeable_n = noticeableForce_N(*std::max_element(run->run.force_N.begin(), run->run.force_N.end()));
  return timed ? "; " + addTickTime(*model, run->gesture, row) : "";
}

// What is fitted to a curve and judged on the same curve advises nobody: interpolation shows how closely a
// model can be bent, and beyond their data the order of the models is chance.
AccuracyRow rowOf(const std::string& model, const char* reference, std::size_t parameters) {
  AccuracyRow row;
  row.scene = kCurveScene;
  row.model = model;
  row.reference = reference;
  row.parameters = static_cast<double>(parameters);
  row.advises = false;
  row.cannot_show = kCannotShow;
  return row;
}

// both halves held out in turn: every bin counts once
void addHalves(const CurveError& a, const CurveError& b, AccuracyRow& row) {
  const auto na = static_cast<double>(a.bins), nb = static_cast<double>(b.bins);
  row.rms_error_n = std::sqrt((a.rms * a.rms * na + b.rms * b.rms * nb) / (na + nb));
  row.max_error_n = std::max(a.max, b.max);
  row.rms_error_spread_n = std::fabs(a.rms - b.rms) / std::sqrt(2.0);
}

AccuracyRow alternateRow(const char* reference, const CurveFit& a, const CurveFit& b,
                         const DepthCurve& curve) {
  AccuracyRow row =
      rowOf(std::string(axialModelName(a.model)), reference, std::max(a.parameters, b.parameters));
  row.variant = a.variant;
  addHalves(a.held_out, b.held_out, row);
  const std::string time = addRun(a, curve.depth_m.back(), reference == kAlternate, row);
  row.uncertainty = fmt::format(
      "{} and {} numbers; {} bins of 0.25 mm held out; error on the fitted halves {:.3f} and {:.3f} N, on "
      "the held-out ones {:.3f} and {:.3f} N; rows scatter {:.2f} N (rms) about their bin's mean, nearly all "
      "of it in the falls at ruptures",
      a.parameters, b.parameters, a.held_out.bins + b.held_out.bins, a.fitted.rms, b.fitted.rms,
      a.held_out.rms, b.held_out.rms, std::max(a.held_out.floor, b.held_out.floor));
  row.uncertainty += time;
  return row;
}

const char* textOf(Baseline baseline) {
  return baseline == Baseline::kConnectTheDots ? "no model: straight lines through the fitted means"
                                               : "no model: the last fitted mean before";
}

constexpr const char* kBaselineCannotShow =
    "anything about tissue: it is what a model has to beat. A model that does not is no better than the data "
    "it was fitted on";

Result<AccuracyRow> baselineRow(const char* reference, Baseline baseline, const DepthCurve& curve,
                                std::size_t most_numbers) {
  ASSIGN_OR_RETURN(const auto a, fitBaseline(curve, baseline, alternateBlocks(0), most_numbers));
  ASSIGN_OR_RETURN(const auto b, fitBaseline(curve, baseline, alternateBlocks(1), most_numbers));
  AccuracyRow row = rowOf(std::string(nameOf(baseline)), reference, std::max(a.parameters, b.parameters));
  row.variant = textOf(baseline);
  row.cannot_show = kBaselineCannotShow;
  addHalves(a.held_out, b.held_out, row);
  row.uncertainty =
      fmt::format("{} and {} numbers; {} bins of 0.25 mm held out: {:.3f} and {:.3f} N", a.parameters,
                  b.parameters, a.held_out.bins + b.held_out.bins, a.held_out.rms, b.held_out.rms);
  return row;
}

// STATISTICAL with the fitted tables as its means: the error is that of one insertion, as a trainee meets it
Result<AccuracyRow> statisticalRow(const std::vector<CurveFit>& tables, const DepthCurve& curve,
                                   int insertions) {
  std::vector<SpreadCheck> checks;
  for (int fold = 0; fold < 2; ++fold) {
    const BinChoice choice = alternateBlocks(fold);
    ASSIGN_OR_RETURN(auto check,
                     checkSpread(curve, spreadAround(curve, tables[static_cast<std::size_t>(fold)], choice),
                                 choice, insertions));
    checks.push_back(std::move(check));
  }
  const std::size_t table_rows = checks[0].scene.spec.statistical.table.size();
  AccuracyRow row = rowOf(std::string(axialModelName(AxialModel::kStatistical)), kAlternate, 2 * table_rows);
  const double in_band = 0.5 * (checks[0].in_band + checks[1].in_band);
  const BandVerdict verdict = bandVerdict(in_band, checks[0].blocks + checks[1].blocks);
  row.variant = fmt::format("mean and sd of {} rows, 1 mm apart; 95 % band {}", table_rows, verdict.text);
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
  row.uncertainty = fmt::format(
      "error of one insertion, mean of {} per half; the mean of all insertions is off by {:.3f} and {:.3f} "
      "N; {:.0f} % and {:.0f} % of the rows held out after the contact lie within the 95 % band, over {} "
      "blocks of 0.5 mm: {}; ",
      insertions, checks[0].held_out_of_mean.rms, checks[1].held_out_of_mean.rms, 100 * checks[0].in_band,
      100 * checks[1].in_band, checks[0].blocks + checks[1].blocks, verdict.text);
  row.uncertainty += addTickTime(*model, run->gesture, row);
  return row;
}

AccuracyRow extrapolationRow(const CurveFit& fit, const BaselineFit& holding, const DepthCurve& curve) {
  AccuracyRow row = rowOf(std::string(axialModelName(fit.model)), kExtrapolation, fit.parameters);
  row.variant = fit.variant;
  row.rms_error_n = fit.held_out.rms;
  row.max_error_n = fit.held_out.max;
  const std::string time = addRun(fit, curve.depth_m.back(), false, row);
  row.uncertainty = fmt::format(
      "{} bins of 0.25 mm held out; error on the fitted part {:.3f} N; {} than holding the force at 25 mm to "
      "the end, {:.3f} N: no model of one insertion knows of what lies ahead",
      fit.held_out.bins, fit.fitted.rms, fit.held_out.rms < holding.held_out.rms ? "less" : "no less",
      holding.held_out.rms);
  row.uncertainty += time;
  return row;
}

AccuracyRow extrapolationRow(const BaselineFit& fit) {
  AccuracyRow row = rowOf(std::string(nameOf(fit.baseline)), kExtrapolation, fit.parameters);
  row.variant = "no model: the force at 25 mm to the end";
  row.cannot_show = kBaselineCannotShow;
  row.rms_error_n = fit.held_out.rms;
  row.max_error_n = fit.held_out.max;
  row.uncertainty = fmt::format("{} bins of 0.25 mm held out", fit.held_out.bins);
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
  ASSIGN_OR_RETURN(const auto recorded, readForceOverDepth(options.data / kLiverHeartFile, &backward));
  const DepthCurve curve = depthCurve(recorded);
  notes.push_back(
      fmt::format("{}: digitised in several passes ({} steps back in depth): sorted by depth, means over "
                  "0.25 mm; falls within one bin are between the needle's force before and after",
                  kCurveScene, backward));

  AccuracyRows alternate, equal, extrapolated;
  for (const Baseline baseline : kBaselines) {
    ASSIGN_OR_RETURN(auto all, baselineRow(kAlternate, baseline, curve, kAnyNumbers));
    alternate.push_back(std::move(all));
    ASSIGN_OR_RETURN(auto some, baselineRow(kEqual, baseline, curve, kEqualNumbers));
    equal.push_back(std::move(some));
    ASSIGN_OR_RETURN(const auto ahead, fitBaseline(curve, baseline, beforeTheSplit()));
    extrapolated.push_back(extrapolationRow(ahead));
  }
  ASSIGN_OR_RETURN(const auto holding, fitBaseline(curve, Baseline::kHoldTheLast, beforeTheSplit()));

  // the same models for each choice of fitted rows
  const std::vector<BinChoice> choices = {alternateBlocks(0), alternateBlocks(1), beforeTheSplit()};
  std::vector<std::vector<CurveModel>> models, few;
  for (const BinChoice& choice : choices) {
    models.push_back(curveModels(chosenBins(curve, choice)));
    few.push_back(curveModels(chosenBins(curve, choice), kEqualNumbers));
  }
  for (std::size_t m = 0; m < models.front().size(); ++m) {
    std::vector<CurveFit> fits, few_fits;
    for (std::size_t c = 0; c < choices.size(); ++c) {
      if (progress)
        progress("fitting " + std::string(axialModelName(models[c][m].model)) + " to " + kCurveScene,
                 (static_cast<double>(m) + static_cast<double>(c) / 3) /
                     static_cast<double>(models.front().size()));
      ASSIGN_OR_RETURN(auto fit, fitCurve(curve, models[c][m], choices[c]));
      if (c < 2) {
        // a model that has no more numbers anyway is the same
        if (few[c][m].numbers() == models[c][m].numbers()) {
          few_fits.push_back(fit);
        } else {
          ASSIGN_OR_RETURN(auto small, fitCurve(curve, few[c][m], choices[c]));
          few_fits.push_back(std::move(small));
        }
      }
      fits.push_back(std::move(fit));
    }
    if (fits[0].model == AxialModel::kPrecomputed) {
      ASSIGN_OR_RETURN(auto row, statisticalRow(fits, curve, options.long_form ? 1000 : 100));
      alternate.push_back(std::move(row));
    }
    alternate.push_back(alternateRow(kAlternate, fits[0], fits[1], curve));
    equal.push_back(alternateRow(kEqual, few_fits[0], few_fits[1], curve));
    extrapolated.push_back(extrapolationRow(fits[2], holding, curve));
  }
  AccuracyRows rows = std::move(alternate);
  rows.insert(rows.end(), equal.begin(), equal.end());
  rows.insert(rows.end(), extrapolated.begin(), extrapolated.end());
  return rows;
}

namespace {

constexpr double kPictureTo_m = 0.048;

struct DrawnFit {
  CurveFit fit;
  std::vector<double> depth_mm, force_N;  // the engine's, every 30 µm
};

Result<DepthCurve> readCurve(const AccuracyOptions& options) {
  ASSIGN_OR_RETURN(const auto rows, readForceOverDepth(options.data / kLiverHeartFile));
  return depthCurve(rows);
}

Result<DrawnFit> drawn(const DepthCurve& curve, const CurveModel& model, const BinChoice& choice) {
  ASSIGN_OR_RETURN(auto fit, fitCurve(curve, model, choice));
  ASSIGN_OR_RETURN(const auto run, runCurve(fit.scene, kPictureTo_m));
  DrawnFit made{std::move(fit), {}, {}};
  for (double d = 0; d < kPictureTo_m; d += 3e-5) made.depth_mm.push_back(d);
  made.force_N = forceAtDepths(run, made.fit.scene.surface_m, made.depth_mm);
  for (double& d : made.depth_mm) d *= 1e3;
  return made;
}

// recorded rows, in mm: those fitted on, and those held out; `suffix` of the blocks' names
void addRecorded(const DepthCurve& curve, const BinChoice& choice, const std::string& suffix,
                 PlotBlocks& data) {
  std::vector<std::vector<double>> fitted(2), held_out(2);
  for (const CurveBin& bin : curve.bins)
    for (const std::size_t i : bin.rows) {
      auto& side = choice(bin) ? fitted : held_out;
      side[0].push_back(curve.depth_m[i] * 1e3);
      side[1].push_back(curve.force_N[i]);
    }
  data.columns("fitted" + suffix, fitted);
  data.columns("heldout" + suffix, held_out);
}

std::string modelText(const CurveFit& fit) {
  switch (fit.model) {
    case AxialModel::kEnhancedTrackingWall:
      return fit.variant.starts_with("PUNCTURE") ? "enhanced wall, membranes" : "enhanced wall, layers";
    case AxialModel::kTrackingWall:
      return "tracking wall (2018), layers";
    case AxialModel::kDirect:
      return "direct, layers";
    case AxialModel::kVoigt:
      return "Voigt";
    case AxialModel::kGodObject:
      return "god object";
    case AxialModel::kFirstOrder:
      return "first order";
    case AxialModel::kOkamura:
      return "Okamura whole";
    case AxialModel::kDahl:
      return "modified Dahl";
    case AxialModel::kPrecomputed:
      return "precomputed table";
    default:
      return std::string(axialModelName(fit.model));
  }
}

}  // namespace

Result<RecordedPicture> recordedCurvePicture(const AccuracyOptions& options) {
  ASSIGN_OR_RETURN(const auto curve, readCurve(options));
  PlotBlocks data;
  std::vector<std::pair<std::string, std::vector<double>>> csv = {{"depth_m", curve.depth_m},
                                                                  {"recorded_n", curve.force_N}};
  std::string finding;
  double wall_N = 0;
  std::vector<std::string> legend, baselines;
  // panel 0: every second block held out; panel 1: all beyond 25 mm
  for (const bool extrapolates : {false, true}) {
    const int panel = extrapolates ? 1 : 0;
    const BinChoice choice = extrapolates ? beforeTheSplit() : alternateBlocks(1);
    const auto chosen = chosenBins(curve, choice);
    const std::vector<CurveModel> models = {layeredModel(AxialModel::kEnhancedTrackingWall, chosen),
                                            membraneModel(chosen), lineModel(AxialModel::kVoigt, chosen)};
    addRecorded(curve, choice, fmt::format(" {}", panel), data);
    for (std::size_t m = 0; m < models.size(); ++m) {
      ASSIGN_OR_RETURN(const auto model, drawn(curve, models[m], choice));
      data.columns(fmt::format("model {} {}", panel, m), {model.depth_mm, model.force_N});
      legend.push_back(fmt::format("{} ({} numbers): {:.2f} N", modelText(model.fit), model.fit.parameters,
                                   model.fit.held_out.rms));
      csv.emplace_back(fmt::format("{}_{}_n", extrapolates ? "extrapolated" : "alternate", m),
                       model.fit.model_N);
      if (!extrapolates && m == 0) wall_N = model.fit.held_out.rms;
    }
    const Baseline baseline = extrapolates ? Baseline::kHoldTheLast : Baseline::kConnectTheDots;
    ASSIGN_OR_RETURN(const auto no_model, fitBaseline(curve, baseline, choice));
    const double no_model_N = no_model.held_out.rms;
    baselines.push_back(fmt::format("no model, {}: {:.2f} N",
                                    extrapolates ? "the last force held" : "the dots connected", no_model_N));
    if (!extrapolates)
      finding =
          fmt::format("Interpolating, {}: {:.2f} N against {:.2f} N; ahead, no model knows",
                      no_model_N <= wall_N ? "connected dots beat the wall" : "the wall beats connected dots",
                      std::min(no_model_N, wall_N), std::max(no_model_N, wall_N));
  }
  return RecordedPicture{"recorded_curve",
                         csvOf(csv),
                         data.text(),
                         {{"finding", finding},
                          {"legend", legend},
                          {"baselines", baselines},
                          {"block_mm", kDepthBlock_m * 1e3},
                          {"split_mm", kExtrapolateFrom_m * 1e3}}};
}

Result<RecordedPicture> recordedModelsPicture(const AccuracyOptions& options) {
  ASSIGN_OR_RETURN(const auto curve, readCurve(options));
  const BinChoice choice = alternateBlocks(1);
  const auto models = curveModels(chosenBins(curve, choice));
  PlotBlocks data;
  addRecorded(curve, choice, "", data);
  std::vector<std::pair<std::string, std::vector<double>>> csv = {{"depth_m", curve.depth_m},
                                                                  {"recorded_n", curve.force_N}};
  std::vector<std::string> names, errors;
  double least = 1e9, most = 0;
  for (std::size_t m = 0; m < models.size(); ++m) {
    ASSIGN_OR_RETURN(const auto model, drawn(curve, models[m], choice));
    least = std::min(least, model.fit.held_out.rms);
    most = std::max(most, model.fit.held_out.rms);
    csv.emplace_back(fmt::format("model_{}_n", m), model.fit.model_N);
    data.columns(fmt::format("model {}", m), {model.depth_mm, model.force_N});
    names.push_back(modelText(model.fit));
    errors.push_back(fmt::format("{} numbers: {:.2f} N rms", model.fit.parameters, model.fit.held_out.rms));
  }
  ASSIGN_OR_RETURN(const auto dots, fitBaseline(curve, Baseline::kConnectTheDots, choice));
  return RecordedPicture{"recorded_models",
                         csvOf(csv),
                         data.text(),
                         {{"finding", fmt::format("Models follow a recorded needle to {:.2f}-{:.2f} N; "
                                                  "connected dots, no model at all, to {:.2f} N",
                                                  least, most, dots.held_out.rms)},
                          {"names", names},
                          {"errors", errors}}};
}

}  // namespace needlelab
