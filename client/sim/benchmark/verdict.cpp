#include "client/sim/benchmark/verdict.h"

#include <fmt/core.h>

#include <algorithm>

#include "client/sim/tools/small_sample.h"

namespace needlelab {
namespace {

template <typename Takes>
const BenchmarkRow* leastError(const std::vector<BenchmarkRow>& rows, Takes takes) {
  const BenchmarkRow* least = nullptr;
  for (const BenchmarkRow& row : rows)
    if (takes(row) && (least == nullptr || row.error_N < least->error_N)) least = &row;
  return least;
}

const BenchmarkRow* bestTrivial(const QuestionResult& question) {
  return leastError(question.rows, [](const BenchmarkRow& row) { return row.kind == ModelKind::kTrivial; });
}

PairedDifference difference(const BenchmarkRow& from, const BenchmarkRow& row) {
  std::vector<double> off_N;
  for (std::size_t i = 0; i < row.unit_errors_N.size(); ++i)
    off_N.push_back(from.unit_errors_N[i] - row.unit_errors_N[i]);
  const MeanInterval interval = meanInterval(off_N);
  PairedDifference paired{interval.mean, {}, {}};
  if (interval.count > 1) {
    paired.low_N = interval.low;
    paired.high_N = interval.high;
  }
  return paired;
}

// Returns why no verdict can be given; empty if it can.
std::string tooFew(const QuestionResult& question) {
  if (question.units.size() < kMinUnits)
    return fmt::format("{} {}, at least {} are needed", question.units.size(),
                       question.units.size() == 1 ? "unit" : "units", kMinUnits);
  if (!predictedIn(question.what).empty() && !asksForPhase(question.what) && question.held_out < kMinUnits)
    return fmt::format("{} held out, at least {} are needed", question.held_out, kMinUnits);
  return {};
}

BenchmarkVerdict verdictOf(const BenchmarkRow& row, double margin_N) {
  if (*row.beats->low_N > margin_N && *row.behind->high_N <= margin_N) return BenchmarkVerdict::kNamed;
  if (*row.beats->high_N <= margin_N) return BenchmarkVerdict::kTrivial;
  if (*row.behind->low_N > margin_N) return BenchmarkVerdict::kInferior;
  return BenchmarkVerdict::kUndecided;
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

std::string labelOf(const BenchmarkRow& row) {
  return row.model + (row.variant.starts_with("PUNCTURE") ? " with membranes" : "");
}

std::string namesOf(const QuestionResult& question, BenchmarkVerdict verdict) {
  std::vector<std::string> names;
  for (const BenchmarkRow& row : question.rows)
    if (row.verdict == verdict) names.push_back(labelOf(row));
  return listOf(names);
}

// The smallest error, what counts as equally good, and which of them has the fewest numbers.
std::string namedText(const std::vector<const BenchmarkRow*>& named) {
  std::vector<std::string> others;
  const BenchmarkRow* fewest = named.front();
  for (const BenchmarkRow* row : named) {
    if (row != named.front()) others.push_back(labelOf(*row));
    if (row->parameters < fewest->parameters) fewest = row;
  }
  std::string text = labelOf(*named.front());
  if (!others.empty()) text += "; as good within the margin: " + listOf(others);
  if (named.size() > 1)
    text += fmt::format("; fewest numbers: {} ({})", labelOf(*fewest), fewest->parameters);
  return text;
}

// Whether every model is shown to be no better than the trivial one, or worse than one that is.
bool noLaw(const QuestionResult& question) {
  const BenchmarkRow* best = question.best();
  return best != nullptr && best->verdict == BenchmarkVerdict::kTrivial && question.named().empty();
}

std::string textOf(const QuestionResult& question) {
  const BenchmarkRow *best = question.best(), *trivial = bestTrivial(question);
  std::string text = fmt::format("{} ({}). ", nameOf(question.what), questionOf(question.what));
  for (const BenchmarkRow& row : question.rows)
    if (row.kind == ModelKind::kFloor && !asksForPhase(question.what))
      text += fmt::format("Noise floor, no competitor: {} {}, {} numbers. ", row.model, errorText(row),
                          row.parameters);
  if (best == nullptr || trivial == nullptr) return text + "No model could be fitted.";
  text += fmt::format("Trivial: {} {}. Least error of the models: {} ({} numbers), {}. ", trivial->model,
                      errorText(*trivial), labelOf(*best), best->parameters, errorText(*best));
  if (question.what == HoldOut::kBlocks)
    return text + "It shows how closely a model bends, not that it predicts.";
  text += fmt::format("Margin: {:.3f} N. ", question.margin_N);
  if (const std::string why = tooFew(question); !why.empty())
    return text + "The data cannot tell which model predicts: " + why + ".";
  const auto named = question.named();
  text += !named.empty() ? "Named: " + namedText(named) + "."
          : noLaw(question)
              ? fmt::format("No law is named: none beats {} by more than the margin.", trivial->model)
              : "None is named: the data cannot tell which model predicts.";
  const auto add = [&](const char* what, BenchmarkVerdict verdict) {
    if (const std::string names = namesOf(question, verdict); !names.empty())
      text += fmt::format(" {}: {}.", what, names);
  };
  add("Worse than the best by more than the margin", BenchmarkVerdict::kInferior);
  add("No better than trivial", BenchmarkVerdict::kTrivial);
  add("Not decided", BenchmarkVerdict::kUndecided);
  return text;
}

}  // namespace

std::string_view nameOf(BenchmarkVerdict verdict) {
  constexpr std::array<std::string_view, 5> kNames = {"", "named", "worse than the best",
                                                      "no better than trivial", "cannot tell"};
  return kNames[static_cast<std::size_t>(verdict)];
}

const BenchmarkRow* QuestionResult::best() const {
  return leastError(rows, [](const BenchmarkRow& row) { return isModel(row.kind); });
}

std::vector<const BenchmarkRow*> QuestionResult::named() const {
  std::vector<const BenchmarkRow*> all;
  for (const BenchmarkRow& row : rows)
    if (row.verdict == BenchmarkVerdict::kNamed) all.push_back(&row);
  std::stable_sort(all.begin(), all.end(),
                   [](const BenchmarkRow* a, const BenchmarkRow* b) { return a->error_N < b->error_N; });
  return all;
}

void decide(QuestionResult& question, double share) {
  for (const BenchmarkRow& row : question.rows)
    if (row.model == "NO_FORCE") question.margin_N = share * row.error_N;
  const BenchmarkRow *trivial = bestTrivial(question), *best = question.best();
  const bool decides = question.what != HoldOut::kBlocks && tooFew(question).empty();
  if (trivial != nullptr && best != nullptr)
    for (BenchmarkRow& row : question.rows) {
      if (!isModel(row.kind)) continue;
      row.beats = difference(*trivial, row);
      row.behind = difference(row, *best);
      if (question.what != HoldOut::kBlocks)
        row.verdict = decides ? verdictOf(row, question.margin_N) : BenchmarkVerdict::kUndecided;
    }
  question.text = textOf(question);
}

std::string conclusionOf(const BenchmarkReport& report) {
  std::vector<std::string> named, untold, none;
  for (const QuestionResult& question : report.questions) {
    const std::string what(predictedIn(question.what));
    if (what.empty()) continue;
    if (const auto rows = question.named(); !rows.empty())
      named.push_back(fmt::format("For {}: {}.", what, namedText(rows)));
    else
      (noLaw(question) ? none : untold).push_back(what);
  }
  std::string text = listOf(none);
  if (!text.empty())
    text =
        fmt::format("No law is named for {}: none beats a trivial baseline by more than the margin.", text);
  for (const std::string& one : named) text += (text.empty() ? "" : " ") + one;
  if (!untold.empty())
    text += fmt::format("{}The data cannot tell which model predicts the force for {}.",
                        text.empty() ? "" : " ", listOf(untold));
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

}  // namespace needlelab
