#include "client/sim/benchmark/benchmark.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "client/sim/accuracy/recorded_statistical.h"
#include "client/sim/tools/small_sample.h"

namespace needlelab {
namespace {

constexpr std::size_t kLeastBins = 8;  // to fit on

// what is added up of a model in a unit
struct UnitSum {
  double squares = 0;
  std::size_t bins = 0, inside = 0;
};

// a model over all folds of a question
struct Tally {
  std::string name, variant, fault;
  ModelKind kind = ModelKind::kEngine;
  std::size_t parameters = 0;
  double fit_error_N = 0, max_error_N = 0;
  std::map<std::string, UnitSum> units;
  std::size_t folds = 0;
};

// what the engine's models cost and give back, measured once
struct Rendered {
  std::optional<double> median_ns, energy_given_J;
};

struct Asked {
  HoldOut what;
  std::vector<Fold> folds;
};

// who answers for a curve: what a question's values are averaged over
std::string unitOf(HoldOut what, const BinnedCurve& curve, const Fold& fold, bool one_curve) {
  const ForceCurve& source = *curve.source;
  switch (what) {
    case HoldOut::kSpecimen:
      return source.tissue + ", " + source.specimen;
    case HoldOut::kNeedle:
      return source.tissue + ", " + source.needle;
    case HoldOut::kSpeed:
      return source.tissue + ", " + numberText(source.speed_mps) + " m/s";
    default:
      return one_curve
                 ? fold.held_out
                 : fmt::format("{}, {}, {}, {}", source.name, source.tissue, source.specimen, source.needle);
  }
}

// adds a model's errors on the curve's held-out bins
Status judge(const FittedModel& model, const BinnedCurve& curve, std::size_t index, const Fold& fold,
             const std::string& unit, Tally& tally) {
  ASSIGN_OR_RETURN(const auto force_N, model.forces(curve.kind, curve.curve.depth_m));
  UnitSum& sum = tally.units[unit];
  for (const CurveBin& bin : curve.curve.bins) {
    if (fold.fit_on(index, bin)) continue;
    // as curveError: the mean over the bin's rows of model − row
    double off_N = 0, said_N = 0;
    const auto rows = static_cast<double>(bin.rows.size());
    for (const std::size_t row : bin.rows) {
      off_N += (force_N[row] - curve.curve.force_N[row]) / rows;
      said_N += force_N[row] / rows;
    }
    const ForceLimits limits = model.limits(bin.at, said_N);
    sum.squares += off_N * off_N;
    ++sum.bins;
    if (bin.value >= limits.low_N && bin.value <= limits.high_N) ++sum.inside;
    tally.max_error_N = std::max(tally.max_error_N, std::fabs(off_N));
  }
  return {};
}

class Run {
 public:
  Run(const std::vector<BinnedCurve>& curves, const BenchmarkOptions& options,
      const BenchmarkProgress& progress, std::vector<std::string>& notes)
      : curves_(curves), options_(options), progress_(progress), notes_(notes) {}

  void expect(std::size_t folds) { all_folds_ = folds; }
  /// Fits and judges; no rows where every fold had too little to fit on.
  Result<QuestionResult> ask(const Asked& asked);

 private:
  Result<std::vector<Tally>> talliesOf(const Asked& asked);
  void render(const std::vector<FittedModel>& models, double to_m);

  const std::vector<BinnedCurve>& curves_;
  const BenchmarkOptions& options_;
  const BenchmarkProgress& progress_;
  std::vector<std::string>& notes_;
  std::size_t all_folds_ = 1, folds_done_ = 0;
  std::vector<Rendered> rendered_;  // in the order of fitModels; from the first fold of all
};

void Run::render(const std::vector<FittedModel>& models, double to_m) {
  for (const FittedModel& model : models) {
    Rendered& one = rendered_.emplace_back();
    if (!model.scene || !model.fault.empty()) continue;
    if (const auto energy = energyGiven_J(*model.scene, to_m); energy.ok()) one.energy_given_J = *energy;
    if (!options_.times) continue;
    if (const auto time = tickTime_ns(*model.scene, to_m); time.ok()) one.median_ns = *time;
  }
}

Result<std::vector<Tally>> Run::talliesOf(const Asked& asked) {
  std::vector<Tally> tallies;
  for (const Fold& fold : asked.folds) {
    const TrainingSet training = trainingSet(curves_, fold);
    const double share = static_cast<double>(folds_done_++) / static_cast<double>(all_folds_);
    if (training.all.bins.size() < kLeastBins) {
      notes_.push_back(fmt::format("{}: {} bins of 0.25 mm to fit on, {} are needed: not asked",
                                   fold.held_out, training.all.bins.size(), kLeastBins));
      continue;
    }
    const auto say = [&](std::string_view model) {
      if (progress_) progress_(fmt::format("{}: fitting {}", fold.held_out, model), share);
    };
    ASSIGN_OR_RETURN(const auto models, fitModels(training, options_.most_numbers, say));
    if (rendered_.empty()) render(models, training.to_m);
    tallies.resize(models.size());
    for (std::size_t m = 0; m < models.size(); ++m) {
      const FittedModel& model = models[m];
      Tally& tally = tallies[m];
      if (tally.name.empty()) {
        tally.name = model.name;
        tally.variant = model.variant;
        tally.kind = model.kind;
      }
      if (tally.fault.empty()) tally.fault = model.fault;
      if (!tally.fault.empty()) continue;
      tally.parameters = std::max(tally.parameters, model.parameters);
      tally.fit_error_N += model.fit_error_N;
      ++tally.folds;
      for (const std::size_t i : fold.curves) {
        const auto& bins = curves_[i].curve.bins;
        if (std::all_of(bins.begin(), bins.end(), [&](const CurveBin& bin) { return fold.fit_on(i, bin); }))
          continue;
        const std::string unit = unitOf(asked.what, curves_[i], fold, fold.curves.size() == 1);
        if (const Status status = judge(model, curves_[i], i, fold, unit, tally); !status.ok())
          tally.fault = status.error().message;
      }
    }
  }
  return tallies;
}

// the verdict about a band, from the units where there are enough, else from the blocks of the curve itself
std::string bandText(const Tally& tally, double share) {
  std::vector<double> shares;
  std::size_t bins = 0;
  for (const auto& [name, sum] : tally.units) {
    shares.push_back(static_cast<double>(sum.inside) / static_cast<double>(sum.bins));
    bins += sum.bins;
  }
  const auto bins_per_block = static_cast<std::size_t>(std::lround(kDepthBlock_m / kDepthBin_m));
  const BandVerdict of_blocks = bandVerdict(share, std::max<std::size_t>(1, bins / bins_per_block));
  if (shares.size() < kLeastUnits) return of_blocks.text;
  const MeanInterval of_units = meanInterval(shares);
  const char* found = of_units.high < 0.95                          ? "MISSED: too narrow"
                      : of_units.low > 0.95 && of_blocks.low > 0.95 ? "MISSED: too wide"
                                                                    : "kept";
  return fmt::format("{}, {:.0f} % inside ({:.0f} to {:.0f} %)", found, 100 * of_units.mean,
                     100 * std::max(0.0, of_units.low), 100 * std::min(1.0, of_units.high));
}

BenchmarkRow rowOf(HoldOut what, const Tally& tally, const Rendered& rendered) {
  BenchmarkRow row;
  row.what = what;
  row.model = tally.name;
  row.variant = tally.variant;
  row.kind = tally.kind;
  row.parameters = tally.parameters;
  row.units = tally.units.size();
  std::size_t bins = 0, inside = 0;
  for (const auto& [name, sum] : tally.units) {
    row.unit_errors_N.push_back(std::sqrt(sum.squares / static_cast<double>(sum.bins)));
    bins += sum.bins;
    inside += sum.inside;
  }
  const MeanInterval error = meanInterval(row.unit_errors_N);
  row.error_N = error.mean;
  if (error.count > 1) {
    row.error_low_N = std::max(0.0, error.low);
    row.error_high_N = error.high;
  }
  row.max_error_N = tally.max_error_N;
  row.fit_error_N = tally.fit_error_N / static_cast<double>(tally.folds);
  row.in_band = static_cast<double>(inside) / static_cast<double>(bins);
  row.band = bandText(tally, row.in_band);
  row.median_ns = rendered.median_ns;
  row.energy_given_J = rendered.energy_given_J;
  return row;
}

const BenchmarkRow* betterBaseline(const std::vector<BenchmarkRow>& rows) {
  const BenchmarkRow* better = nullptr;
  for (const BenchmarkRow& row : rows)
    if (row.kind == ModelKind::kBaseline && (better == nullptr || row.error_N < better->error_N))
      better = &row;
  return better;
}

std::vector<double> differences(const BenchmarkRow& from, const BenchmarkRow& row) {
  std::vector<double> off_N;
  for (std::size_t i = 0; i < row.unit_errors_N.size(); ++i)
    off_N.push_back(from.unit_errors_N[i] - row.unit_errors_N[i]);
  return off_N;
}

// The same as logarithms of the ratio: one unit may be harder than another for all models, and a difference
// in newtons would then say more of the unit than of the models.
std::vector<double> logRatios(const BenchmarkRow& from, const BenchmarkRow& row) {
  constexpr double kLeast_N = 1e-9;  // of errors: exact in practice
  std::vector<double> ratios;
  for (std::size_t i = 0; i < row.unit_errors_N.size(); ++i)
    ratios.push_back(
        std::log(std::max(kLeast_N, from.unit_errors_N[i]) / std::max(kLeast_N, row.unit_errors_N[i])));
  return ratios;
}

// every model beside the better baseline
void compare(HoldOut what, std::vector<BenchmarkRow>& rows) {
  const BenchmarkRow* baseline = betterBaseline(rows);
  if (baseline == nullptr) return;
  std::vector<std::pair<BenchmarkRow*, double>> models;  // with the mean logarithm of how much better
  std::vector<double> p;
  for (BenchmarkRow& row : rows) {
    if (row.kind == ModelKind::kBaseline) {
      row.verdict = BenchmarkVerdict::kBaseline;
      continue;
    }
    const std::vector<double> better_N = differences(*baseline, row);
    const MeanInterval interval = meanInterval(better_N);
    row.better_N = interval.mean;
    row.verdict = what == HoldOut::kBlocks ? BenchmarkVerdict::kFits : BenchmarkVerdict::kCannotTell;
    if (interval.count < 2) continue;
    row.better_low_N = interval.low;
    row.better_high_N = interval.high;
    if (what == HoldOut::kBlocks || row.units < kLeastUnits) continue;
    const std::vector<double> ratios = logRatios(*baseline, row);
    models.push_back({&row, meanInterval(ratios).mean});
    p.push_back(meanIsZero(ratios));
  }
  const std::vector<double> corrected = holmCorrected(p);
  for (std::size_t i = 0; i < models.size(); ++i) {
    auto& [row, better] = models[i];
    row->p = corrected[i];
    if (corrected[i] <= 0.05)
      row->verdict = better > 0 ? BenchmarkVerdict::kPredicts : BenchmarkVerdict::kWorse;
  }
}

std::string labelOf(const BenchmarkRow& row) {
  return fmt::format("{} ({}; {} numbers)", row.model, row.variant, row.parameters);
}

std::string errorText(const BenchmarkRow& row) {
  std::string text = fmt::format("{:.3f} N", row.error_N);
  if (row.error_low_N) text += fmt::format(" ({:.3f} to {:.3f})", *row.error_low_N, *row.error_high_N);
  return text;
}

std::string listOf(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return text;
}

// the models that the units cannot tell from the best one
std::vector<std::string> asGoodAs(const QuestionResult& question, const BenchmarkRow& best) {
  std::vector<std::string> names;
  for (const BenchmarkRow& row : question.rows)
    if (&row != &best && row.kind != ModelKind::kBaseline && meanIsZero(logRatios(row, best)) > 0.05)
      names.push_back(row.model);
  return names;
}

std::string textOf(const QuestionResult& question) {
  const BenchmarkRow *best = question.best(), *baseline = betterBaseline(question.rows);
  std::string text = fmt::format("{} ({}). ", nameOf(question.what), questionOf(question.what));
  for (const BenchmarkRow& row : question.rows)
    if (row.kind == ModelKind::kBaseline) text += fmt::format("{} {}; ", row.model, errorText(row));
  if (best == nullptr || baseline == nullptr) return text + "no model could be fitted.";
  text += fmt::format("least error of the models: {}, {}. ", labelOf(*best), errorText(*best));
  if (question.what == HoldOut::kBlocks)
    return text +
           (best->error_N < baseline->error_N
                ? "It is below the baselines, but shows how closely a model bends, not that it predicts."
                : "No model does as well as joining the dots: what is asked here needs no model.");
  const std::size_t units = question.units.size();
  if (units < kLeastUnits)
    return text + fmt::format("The data cannot tell which predicts: {} {}, at least {} are needed.", units,
                              units == 1 ? "held-out value" : "held-out values", kLeastUnits);
  std::vector<std::string> predicts, worse;
  for (const BenchmarkRow& row : question.rows) {
    if (row.verdict == BenchmarkVerdict::kPredicts) predicts.push_back(row.model);
    if (row.verdict == BenchmarkVerdict::kWorse) worse.push_back(row.model);
  }
  text += predicts.empty()
              ? fmt::format(
                    "No model is shown to beat {} (Holm's p above 0.05, {} units): the data "
                    "cannot tell a model from it.",
                    baseline->model, units)
              : fmt::format("Shown to beat {} over {} units: {}.", baseline->model, units, listOf(predicts));
  if (!worse.empty()) text += " Shown to be worse: " + listOf(worse) + ".";
  if (best->verdict == BenchmarkVerdict::kPredicts)
    if (const auto alike = asGoodAs(question, *best); !alike.empty())
      text += fmt::format(" Not told apart from {}: {}.", best->model, listOf(alike));
  return text;
}

// what tells insertions of a tissue apart
struct Trait {
  HoldOut what;
  std::string (*value)(const BinnedCurve&);
};
constexpr std::array<Trait, 3> kTraits = {
    {{HoldOut::kSpecimen, [](const BinnedCurve& one) { return one.source->specimen; }},
     {HoldOut::kNeedle, [](const BinnedCurve& one) { return one.source->needle; }},
     {HoldOut::kSpeed, [](const BinnedCurve& one) { return numberText(one.kind.speed_mps); }}}};

// two traits that always change together cannot be told apart
bool entangled(const std::vector<BinnedCurve>& curves, const Trait& a, const Trait& b) {
  std::map<std::string, std::set<std::string>> bs, as;
  for (const BinnedCurve& curve : curves) {
    const std::string in = curve.source->tissue + "\n";
    bs[in + a.value(curve)].insert(b.value(curve));
    as[in + b.value(curve)].insert(a.value(curve));
  }
  const auto single = [](const auto& map) {
    return std::all_of(map.begin(), map.end(), [](const auto& one) { return one.second.size() == 1; });
  };
  std::set<std::string> tissues;
  for (const BinnedCurve& curve : curves) tissues.insert(curve.source->tissue);
  return bs.size() > tissues.size() && single(bs) && single(as);
}

std::string conclusionOf(const BenchmarkReport& report) {
  std::vector<std::string> predicts, untold;
  for (const QuestionResult& question : report.questions) {
    if (!asksForPrediction(question.what)) continue;
    const BenchmarkRow* best = question.best();
    if (best != nullptr && best->verdict == BenchmarkVerdict::kPredicts)
      predicts.push_back(
          fmt::format("{} for an unseen {} ({})", best->model, nameOf(question.what), errorText(*best)));
    else
      untold.push_back(std::string(nameOf(question.what)));
  }
  std::string text;
  if (!predicts.empty()) text = "Predicts rather than fits: " + listOf(predicts) + ".";
  if (!untold.empty())
    text +=
        (text.empty() ? "" : " ") +
        fmt::format("The data cannot tell which model predicts the force for an unseen {}.", listOf(untold));
  const auto counted = [](std::size_t count, const char* one) {
    return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
  };
  if (text.empty())
    text = fmt::format(
        "The data cannot tell which model predicts: no insertion could be held out as a whole ({}, {}, {})",
        counted(report.specimens, "specimen"), counted(report.needles, "needle"),
        counted(report.speeds, "speed"));
  return text;
}

template <typename Value>
std::size_t countOf(const std::vector<BinnedCurve>& curves, Value value) {
  std::set<decltype(value(curves.front()))> all;
  for (const BinnedCurve& curve : curves) all.insert(value(curve));
  return all.size();
}

Result<QuestionResult> Run::ask(const Asked& asked) {
  QuestionResult question;
  question.what = asked.what;
  ASSIGN_OR_RETURN(const auto tallies, talliesOf(asked));
  for (std::size_t m = 0; m < tallies.size(); ++m) {
    if (!tallies[m].fault.empty()) {
      notes_.push_back(
          fmt::format("{}: {} is left out: {}", nameOf(asked.what), tallies[m].name, tallies[m].fault));
      continue;
    }
    if (question.units.empty())
      for (const auto& [name, sum] : tallies[m].units) question.units.push_back(name);
    question.rows.push_back(rowOf(asked.what, tallies[m], rendered_[m]));
  }
  compare(asked.what, question.rows);
  question.text = textOf(question);
  return question;
}

}  // namespace

std::string_view nameOf(BenchmarkVerdict verdict) {
  constexpr std::array<std::string_view, 5> kNames = {"baseline", "predicts", "worse than a baseline",
                                                      "cannot tell", "fits only"};
  return kNames[static_cast<std::size_t>(verdict)];
}

const BenchmarkRow* QuestionResult::best() const {
  const BenchmarkRow* least = nullptr;
  for (const BenchmarkRow& row : rows)
    if (row.kind != ModelKind::kBaseline && (least == nullptr || row.error_N < least->error_N)) least = &row;
  return least;
}

Result<BenchmarkReport> runBenchmark(const CurveSet& set, const BenchmarkOptions& options,
                                     const BenchmarkProgress& progress) {
  if (options.most_numbers < kLeastNumbers || options.most_numbers > kMostBenchmarkNumbers)
    return Error{ErrorCode::kInvalidInput, fmt::format("--numbers {}: must be {} to {}", options.most_numbers,
                                                       kLeastNumbers, kMostBenchmarkNumbers)};
  if (set.curves.empty()) return Error{ErrorCode::kInvalidInput, "no force curve to run on"};
  const std::vector<BinnedCurve> curves = binnedCurves(set);
  BenchmarkReport report;
  report.data = set.name;
  report.licence = set.licence;
  report.source = set.source;
  report.notes = set.notes;
  report.most_numbers = options.most_numbers;
  report.curves = curves.size();
  report.tissues = countOf(curves, [](const BinnedCurve& one) { return one.source->tissue; });
  report.specimens = countOf(
      curves, [](const BinnedCurve& one) { return std::pair(one.source->tissue, one.source->specimen); });
  report.needles = countOf(curves, [](const BinnedCurve& one) { return one.source->needle; });
  report.speeds = countOf(curves, [](const BinnedCurve& one) { return one.kind.speed_mps; });
  for (std::size_t a = 0; a < kTraits.size(); ++a)
    for (std::size_t b = a + 1; b < kTraits.size(); ++b)
      if (entangled(curves, kTraits[a], kTraits[b]))
        report.notes.push_back(
            fmt::format("{} and {} always change together: what is said of one may be the other's",
                        nameOf(kTraits[a].what), nameOf(kTraits[b].what)));

  std::vector<Asked> all;
  std::size_t folds = 0;
  for (const HoldOut what : kHoldOuts) {
    const auto& wanted = options.questions;
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), what) == wanted.end()) continue;
    Asked asked{what, foldsOf(what, curves)};
    if (asked.folds.empty()) {
      report.notes.push_back(
          fmt::format("no question about an unseen {}: each tissue has only one", nameOf(what)));
      continue;
    }
    folds += asked.folds.size();
    all.push_back(std::move(asked));
  }
  Run run(curves, options, progress, report.notes);
  run.expect(folds);
  for (const Asked& asked : all) {
    ASSIGN_OR_RETURN(auto question, run.ask(asked));
    if (!question.rows.empty()) report.questions.push_back(std::move(question));
  }
  report.conclusion = conclusionOf(report);
  return report;
}

}  // namespace needlelab
