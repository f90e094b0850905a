#include "client/sim/benchmark/benchmark.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include "client/sim/benchmark/unit_errors.h"
#include "client/sim/benchmark/verdict.h"

namespace needlelab {
namespace {

constexpr std::size_t kMinBins = 8;  // minimum to fit on

// Cost and released energy of the engine's models, measured once.
struct Rendered {
  std::optional<double> median_ns, energy_given_J;
};

// Questions answered by the same fits.
struct Asked {
  std::vector<HoldOut> questions;
  std::vector<Fold> folds;
};

class Run {
 public:
  Run(const std::vector<BinnedCurve>& curves, const BenchmarkOptions& options,
      const BenchmarkProgress& progress, std::vector<std::string>& notes)
      : curves_(curves), options_(options), progress_(progress), notes_(notes) {}

  void expect(std::size_t folds) { all_folds_ = folds; }
  /// Fits and judges; no rows if all folds had too little data to fit on or to judge.
  Result<std::vector<QuestionResult>> ask(const Asked& asked);

 private:
  /// A model's errors on the fold's held-out bins.
  Status addErrors(HoldOut what, const Fold& fold, const FittedModel& model,
                   const std::vector<PredictedBins>& said, Tally& tally) const;
  void render(const std::vector<FittedModel>& models, double to_m);

  const std::vector<BinnedCurve>& curves_;
  const BenchmarkOptions& options_;
  const BenchmarkProgress& progress_;
  std::vector<std::string>& notes_;
  std::size_t all_folds_ = 1, folds_done_ = 0;
  std::vector<Rendered> rendered_;  // in the order of fitModels; from the very first fold
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

Status Run::addErrors(HoldOut what, const Fold& fold, const FittedModel& model,
                      const std::vector<PredictedBins>& said, Tally& tally) const {
  for (std::size_t k = 0; k < fold.curves.size(); ++k) {
    const ForceCurve& source = *curves_[fold.curves[k]].source;
    const std::string unit = unitOf(what, source);
    if (asksForPhase(what)) {
      ASSIGN_OR_RETURN(const PredictedBins after, predictHoldOrWithdrawal(what, model, source));
      tally.add(unit, after);
    } else if (what == HoldOut::kSpecimenStart) {
      const auto [start, rest] = cutAt(said[k], options_.calibration_m);
      if (!start.empty()) tally.add(unit, rest, factorOf(start));
    } else if (what == HoldOut::kSpecimenInsertion) {
      // the specimen's next insertion; for the last one, the first
      std::size_t other = k;
      do other = (other + 1) % said.size();
      while (said[other].empty() && other != k);
      if (other != k) tally.add(unit, said[k], factorOf(said[other]));
    } else {
      tally.add(unit, said[k], 1, model.limits);
    }
  }
  return {};
}

// A property by which a tissue's insertions differ.
struct Trait {
  HoldOut what;
  std::string (*value)(const BinnedCurve&);
};
constexpr std::array<Trait, 3> kTraits = {
    {{HoldOut::kSpecimen, [](const BinnedCurve& one) { return one.source->specimen; }},
     {HoldOut::kNeedle, [](const BinnedCurve& one) { return one.source->needle; }},
     {HoldOut::kSpeed, [](const BinnedCurve& one) { return numberText(one.kind.speed_mps); }}}};

// Two traits that always change together cannot be separated.
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

template <typename Value>
std::size_t countOf(const std::vector<BinnedCurve>& curves, Value value) {
  std::set<decltype(value(curves.front()))> all;
  for (const BinnedCurve& curve : curves) all.insert(value(curve));
  return all.size();
}

Result<std::vector<QuestionResult>> Run::ask(const Asked& asked) {
  std::vector<std::vector<Tally>> tallies(asked.questions.size());
  std::size_t fitted = 0;
  for (const Fold& fold : asked.folds) {
    const TrainingSet training = trainingSet(curves_, fold);
    const double share = static_cast<double>(folds_done_++) / static_cast<double>(all_folds_);
    if (training.all.bins.size() < kMinBins) {
      notes_.push_back(fmt::format("{}: {} bins of 0.25 mm to fit on, {} are needed: not asked",
                                   fold.held_out, training.all.bins.size(), kMinBins));
      continue;
    }
    ++fitted;
    const auto say = [&](std::string_view model) {
      if (progress_) progress_(fmt::format("{}: fitting {}", fold.held_out, model), share);
    };
    ASSIGN_OR_RETURN(const auto models, fitModels(training, options_.max_numbers, say));
    if (rendered_.empty()) render(models, training.to_m);
    for (std::size_t m = 0; m < models.size(); ++m) {
      const FittedModel& model = models[m];
      auto said = model.fault.empty() ? predictionsOf(curves_, fold, model)
                                      : Error{ErrorCode::kInvalidInput, model.fault};
      for (std::size_t q = 0; q < asked.questions.size(); ++q) {
        tallies[q].resize(models.size());
        Tally& tally = tallies[q][m];
        tally.addFold(model);
        Status status =
            said.ok() ? addErrors(asked.questions[q], fold, model, *said, tally) : Status(said.error());
        if (tally.fault.empty() && !status.ok()) tally.fault = status.error().message;
      }
    }
  }
  std::vector<QuestionResult> results;
  for (std::size_t q = 0; q < asked.questions.size(); ++q) {
    QuestionResult question;
    question.what = asked.questions[q];
    question.held_out = fitted;
    for (std::size_t m = 0; m < tallies[q].size(); ++m) {
      const Tally& tally = tallies[q][m];
      if (!tally.fault.empty())
        notes_.push_back(
            fmt::format("{}: {} is omitted: {}", nameOf(question.what), tally.name, tally.fault));
      if (!tally.fault.empty() || tally.units.empty()) continue;
      if (question.units.empty())
        for (const auto& [name, sum] : tally.units) question.units.push_back(name);
      BenchmarkRow& row = question.rows.emplace_back(rowOf(question.what, tally));
      row.place = m;
      row.median_ns = rendered_[m].median_ns;
      row.energy_given_J = rendered_[m].energy_given_J;
    }
    if (question.rows.empty()) {
      notes_.push_back(
          fmt::format("{}: nothing to judge ({})", nameOf(question.what), questionOf(question.what)));
      continue;
    }
    decide(question, options_.margin);
    results.push_back(std::move(question));
  }
  return results;
}

// Returns why a question cannot be asked; empty if it can.
std::string lacking(HoldOut what, const std::vector<BinnedCurve>& curves, const std::vector<Fold>& folds) {
  const auto any = [&](auto has) { return std::any_of(curves.begin(), curves.end(), has); };
  if (what == HoldOut::kHold && !any([](const BinnedCurve& one) { return !one.source->hold.t_s.empty(); }))
    return "no curve has one";
  if (what == HoldOut::kWithdrawal &&
      !any([](const BinnedCurve& one) { return !one.source->withdrawal.depth_m.empty(); }))
    return "no curve has one";
  return folds.empty() ? "each tissue has only one" : "";
}

}  // namespace

Result<BenchmarkReport> runBenchmark(const CurveSet& set, const BenchmarkOptions& options,
                                     const BenchmarkProgress& progress) {
  if (options.max_numbers < kMinNumbers || options.max_numbers > kMaxBenchmarkNumbers)
    return Error{ErrorCode::kInvalidInput, fmt::format("--numbers {}: must be {} to {}", options.max_numbers,
                                                       kMinNumbers, kMaxBenchmarkNumbers)};
  if (!kMargin.contains(options.margin)) return outOfRange("margin", options.margin, kMargin);
  if (!kCalibration_m.contains(options.calibration_m))
    return outOfRange("calibration_m", options.calibration_m, kCalibration_m);
  if (set.curves.empty()) return Error{ErrorCode::kInvalidInput, "no force curve to run on"};
  const std::vector<BinnedCurve> curves = binnedCurves(set);
  BenchmarkReport report;
  report.data = set.name;
  report.licence = set.licence;
  report.source = set.source;
  report.notes = set.notes;
  report.max_numbers = options.max_numbers;
  report.margin = options.margin;
  report.calibration_m = options.calibration_m;
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
            fmt::format("{} and {} always change together: an effect of one may be due to the other",
                        nameOf(kTraits[a].what), nameOf(kTraits[b].what)));

  std::vector<Asked> all;
  std::size_t folds = 0;
  for (const HoldOut what : kHoldOuts) {
    const auto& wanted = options.questions;
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), what) == wanted.end()) continue;
    auto own = foldsOf(what, curves);
    if (const std::string why = lacking(what, curves, own); !why.empty()) {
      report.notes.push_back(fmt::format("{} is not asked: {}", nameOf(what), why));
      continue;
    }
    // The same fits answer the three questions about specimens, and the two about phases.
    if (!all.empty() && (holdsSpecimensOut(what) || asksForPhase(what)) &&
        holdsSpecimensOut(what) == holdsSpecimensOut(all.back().questions.front()) &&
        asksForPhase(what) == asksForPhase(all.back().questions.front())) {
      all.back().questions.push_back(what);
      continue;
    }
    folds += own.size();
    all.push_back({{what}, std::move(own)});
  }
  Run run(curves, options, progress, report.notes);
  run.expect(folds);
  for (const Asked& asked : all) {
    ASSIGN_OR_RETURN(auto questions, run.ask(asked));
    std::move(questions.begin(), questions.end(), std::back_inserter(report.questions));
  }
  report.conclusion = conclusionOf(report);
  return report;
}

}  // namespace needlelab
