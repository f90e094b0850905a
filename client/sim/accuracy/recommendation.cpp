#include "client/sim/accuracy/recommendation.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/panel_layout.h"
#include "client/sim/tools/hand_thresholds.h"

namespace needlelab {
namespace {

// half of tests/bench/README.md's 50 ms: server and network need the rest
constexpr double kMostLatency_ms = 25;
constexpr double kStiffnessMargin = 2;  // theory allows so many times the scene's stiffness
constexpr double kStorageShare = 0.1;   // of a noticeable force

std::string sig(double value, int digits) {
  return fmt::format("{:.{}g}", value, digits);
}

std::string timeText(double ns) {
  if (ns >= 1e9) return sig(ns * 1e-9, 3) + " s";
  if (ns >= 1e6) return sig(ns * 1e-6, 3) + " ms";
  if (ns >= 1e3) return sig(ns * 1e-3, 3) + " µs";
  return sig(ns, 3) + " ns";
}

std::string forceText(double force_N) {
  return newtonText(force_N, 2);
}

bool fits(const AccuracyRow& row) {
  return row.fits_rate.value_or(true);
}
double errorOf(const AccuracyRow& row) {
  return row.rms_error_n.value_or(kUnmeasured);
}

// "good enough" in a study; the finest mesh has no error by definition
bool goodEnough(const AccuracyRow& row) {
  if (row.study == AccuracyStudy::kMesh && !(errorOf(row) > 0)) return false;
  return missOf(row) <= 1;
}

// the saving among the rows that are good enough
double priceOf(const AccuracyRow& row) {
  switch (row.study) {
    case AccuracyStudy::kStorage:
      return row.bytes_per_sample.value_or(kUnmeasured);
    case AccuracyStudy::kLive:
      return row.bytes_per_s.value_or(kUnmeasured);
    case AccuracyStudy::kMesh:
      return row.mesh_nodes.value_or(kUnmeasured);
    case AccuracyStudy::kRate:
      return row.rate_hz.value_or(kUnmeasured);
    case AccuracyStudy::kModel:
      return costOf_ns(row).value_or(CostInterval{kUnmeasured, kUnmeasured, kUnmeasured}).value;
  }
  return kUnmeasured;
}

// a row's distance from "good enough"
double lackOf(const AccuracyRow& row) {
  return row.study == AccuracyStudy::kLive ? row.latency_p99_ms.value_or(kUnmeasured) : errorOf(row);
}

const AccuracyRow* least(const std::vector<const AccuracyRow*>& rows, double (*measure)(const AccuracyRow&)) {
  const auto at = std::min_element(rows.begin(), rows.end(), [&](const AccuracyRow* a, const AccuracyRow* b) {
    return measure(*a) < measure(*b);
  });
  return at == rows.end() || !std::isfinite(measure(**at)) ? nullptr : *at;
}

// the cheapest: what is clearly dearer than another is out; then instructions, then the error decide
const AccuracyRow* cheapest(const std::vector<const AccuracyRow*>& rows) {
  std::vector<const AccuracyRow*> left;
  for (const AccuracyRow* row : rows) {
    const CostError point = pointOf(*row);
    if (!std::isfinite(point.cost)) continue;
    const bool dearer = std::any_of(rows.begin(), rows.end(), [&](const AccuracyRow* other) {
      return costsLess(pointOf(*other), point);
    });
    if (!dearer) left.push_back(row);
  }
  return least(left, errorOf);
}

std::string measuresOf(const AccuracyRow& row) {
  std::string text = "rms error " + forceText(errorOf(row));
  if (row.rms_error_spread_n && *row.rms_error_spread_n > 0)
    text += " ± " + forceText(*row.rms_error_spread_n);
  if (row.stiffness_margin)
    text += ", theory allows " + sig(*row.stiffness_margin, 2) + " times its stiffness";
  if (row.max_step_n) text += ", greatest step in a tick " + forceText(*row.max_step_n);
  if (row.study == AccuracyStudy::kStorage && row.bytes_per_sample)
    text += ", " + sig(*row.bytes_per_sample, 3) + " bytes a sample";
  if (row.study == AccuracyStudy::kLive && row.latency_p99_ms && row.bytes_per_s)
    text +=
        ", latency p99 " + sig(*row.latency_p99_ms, 3) + " ms, " + sig(*row.bytes_per_s * 1e-3, 3) + " kB/s";
  if (row.study == AccuracyStudy::kRate && row.cpu_share)
    text += ", " + sig(100 * *row.cpu_share, 2) + " % of a core";
  else if (row.precompute_s)
    text += ", made in " + sig(*row.precompute_s, 2) + " s before the lesson, then " +
            timeText(row.median_ns.value_or(0)) + " (p99 " + timeText(row.p99_ns.value_or(0)) + ") a tick";
  else if (const auto cost = costOf_ns(row)) {
    text += ", " + timeText(cost->value);
    if (cost->high > cost->low) text += " (" + timeText(cost->low) + " to " + timeText(cost->high) + ")";
    text +=
        row.study == AccuracyStudy::kStorage || row.study == AccuracyStudy::kLive ? " a sample" : " a tick";
  }
  return text;
}

// "; it is 4.3 times the limit"
std::string missText(const AccuracyRow& row) {
  const double miss = missOf(row);
  if (!(miss > 1) || !std::isfinite(miss)) return {};
  return "; with its interval it is " + sig(miss, 2) + " times the limit";
}

std::string conditionOf(const AccuracyRow& row, bool good) {
  const std::string noticed = row.noticeable_n ? forceText(*row.noticeable_n) : "nothing known";
  const std::string noticed_both = noticed + "; a step in time: " + forceText(kNoticeableStep_N);
  switch (row.study) {
    case AccuracyStudy::kModel:
      if (!row.noticeable_n) return "the least error among those that fit";
      return good ? "the cheapest whose error and steps are below what a hand notices (" + noticed_both + ")"
                  : "none is below what a hand notices (" + noticed_both +
                        ") in both error and steps; this has the least error" + missText(row);
    case AccuracyStudy::kRate:
      return good ? "the slowest whose error and steps are below what a hand notices (" + noticed_both +
                        ") and for which theory allows twice the scene's stiffness, whatever the hand"
                  : "none is below what a hand notices (" + noticed_both +
                        ") with twice the scene's stiffness allowed by theory; this has the least error" +
                        missText(row);
    case AccuracyStudy::kMesh:
      return good ? "the coarsest whose error is below what a hand notices (" + noticed + ")"
                  : "none that fits its rate, the comparator aside, is below what a hand notices (" +
                        noticed + "); this has the least error" + missText(row);
    case AccuracyStudy::kStorage:
      return good ? "the fewest bytes with an error below a tenth of what a hand notices (" + noticed + ")"
                  : "none is below a tenth of what a hand notices (" + noticed +
                        "); this has the least error" + missText(row);
    case AccuracyStudy::kLive:
      return good ? "the least bandwidth with a p99 latency below " + sig(kMostLatency_ms, 3) + " ms"
                  : "none has a p99 latency below " + sig(kMostLatency_ms, 3) + " ms; this has the least" +
                        missText(row);
  }
  return {};
}

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return text;
}

// the scene, of meshes with the way they are used
std::string placeOf(const RowGroup& group) {
  const bool by_variant = group.study == AccuracyStudy::kMesh && !group.rows.empty();
  return by_variant && !group.rows[0]->variant.empty() ? group.scene + ", " + group.rows[0]->variant
                                                       : group.scene;
}

std::string beginning(const RowGroup& group) {
  return std::string(nameOf(group.study)) + ", " + placeOf(group) + " (against " + group.reference + "): ";
}

std::string nameIn(const RowGroup& group, const AccuracyRow* row) {
  for (std::size_t i = 0; i < group.rows.size(); ++i)
    if (group.rows[i] == row) return group.names[i];
  return {};
}

// the rest of the group: its front, the rows with less error, those that are too slow
std::string restOf(const RowGroup& group, const AccuracyRow& row) {
  std::string text;
  std::vector<std::string> on_front, unfit, own;
  const std::vector<bool> front = paretoFront(group);
  const AccuracyRow *finer = nullptr, *largest = nullptr;
  for (std::size_t i = 0; i < group.rows.size(); ++i) {
    const AccuracyRow* other = group.rows[i];
    if (front[i]) on_front.push_back(group.names[i]);
    if (!fits(*other)) {
      unfit.push_back(group.names[i]);
      continue;
    }
    if (other->own_law) own.push_back(group.names[i] + " (" + forceText(errorOf(*other)) + ")");
    if (errorOf(*other) < errorOf(finer != nullptr ? *finer : row)) finer = other;
    if (largest == nullptr || other->mesh_nodes.value_or(0) > *largest->mesh_nodes) largest = other;
    if (!largest->mesh_nodes) largest = nullptr;
  }
  if (on_front.size() > 1 && on_front.size() == group.rows.size())
    text += " All are on the front of error and time: each gives something for its price.";
  else if (!on_front.empty())
    text += " On the front of error and time: " + list(on_front) + ".";
  if (group.study == AccuracyStudy::kMesh && largest != nullptr)
    text += " The largest mesh tried that fits its rate: " + nameIn(group, largest) + ".";
  else if (finer != nullptr)
    text += " The least error has " + nameIn(group, finer) + ": " + measuresOf(*finer) + ".";
  if (!own.empty()) text += " Shown only, because the comparator contains their own law: " + list(own) + ".";
  if (!unfit.empty()) text += " Too slow for their rate: " + list(unfit) + ".";
  return text;
}

// the demands of a choice: more is more conservative
double demandOf(const AccuracyRow& row) {
  switch (row.study) {
    case AccuracyStudy::kModel:
      return 0;
    case AccuracyStudy::kMesh:
      return row.mesh_nodes.value_or(0);
    case AccuracyStudy::kRate:
      return row.rate_hz.value_or(0);
    case AccuracyStudy::kStorage:
      return row.quantum_m ? -*row.quantum_m : -kUnmeasured;
    case AccuracyStudy::kLive:
      return row.frame_s ? -*row.frame_s : -kUnmeasured;
  }
  return 0;
}

// one choice for all comparisons of a study: the most frequent model; for the other studies the most
// conservative choice
std::string consensusOf(AccuracyStudy study, const std::vector<Advice>& advices) {
  std::vector<const AccuracyRow*> taken;
  for (const Advice& advice : advices)
    if (advice.votes() && advice.row->study == study) taken.push_back(advice.row);
  if (taken.empty()) return {};
  const auto votes = [&](const AccuracyRow* row) {
    return std::count_if(taken.begin(), taken.end(),
                         [&](const AccuracyRow* other) { return choiceOf(*other) == choiceOf(*row); });
  };
  const AccuracyRow* best = taken.front();
  for (const AccuracyRow* row : taken)
    if (study == AccuracyStudy::kModel ? votes(row) > votes(best) : demandOf(*row) > demandOf(*best))
      best = row;
  const auto count = static_cast<std::size_t>(votes(best));
  if (count == taken.size()) return choiceOf(*best);
  return fmt::format(
      "{} ({}{} of {} comparisons)", choiceOf(*best),
      study == AccuracyStudy::kModel ? "the most frequent choice, in " : "the most careful choice, in ",
      count, taken.size());
}

}  // namespace

Advice adviceFor(const RowGroup& group) {
  std::vector<const AccuracyRow*> fitting, candidates, good;
  for (const AccuracyRow* row : group.rows) {
    if (!fits(*row)) continue;
    fitting.push_back(row);
    if (row->own_law) continue;
    candidates.push_back(row);
    if (goodEnough(*row)) good.push_back(row);
  }
  Advice advice;
  advice.is_choice = group.compares() && !candidates.empty();
  if (advice.is_choice) {
    advice.row = group.study == AccuracyStudy::kModel ? cheapest(good) : least(good, priceOf);
    if (advice.row == nullptr) advice.row = least(good, lackOf);  // where no price was measured
    advice.good_enough = advice.row != nullptr;
    if (advice.row == nullptr) advice.row = least(candidates, lackOf);
  } else {
    advice.row = least(fitting, lackOf);
  }
  if (advice.row == nullptr) {
    advice.text =
        beginning(group) + "nothing fits its rate, or nothing was measured; no choice can be recommended.";
    advice.is_choice = false;
    return advice;
  }
  const std::string name = nameIn(group, advice.row), measures = measuresOf(*advice.row);
  if (advice.is_choice)
    advice.text = beginning(group) +
                  (advice.good_enough ? "take " : "none can be recommended; the nearest is ") + name + ": " +
                  conditionOf(*advice.row, advice.good_enough) + "; " + measures + "." +
                  restOf(group, *advice.row);
  else
    advice.text = beginning(group) +
                  (advice.row->advises ? "nothing to choose from; the least error: "
                                       : "no choice follows; the least error: ") +
                  name + ", " + measures + ".";
  return advice;
}

std::vector<std::string> recommendation(const AccuracyRows& rows) {
  const std::vector<RowGroup> groups = groupsOf(rows);
  std::vector<Advice> advices;
  for (const RowGroup& group : groups) advices.push_back(adviceFor(group));

  // scenes with the same comparator and the same choice share the first one's paragraph
  std::vector<std::string> paragraphs;
  std::vector<bool> said(groups.size());
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (said[i]) continue;
    std::vector<std::string> likewise;
    for (std::size_t k = i + 1; k < groups.size(); ++k) {
      const bool same = advices[i].is_choice && advices[k].is_choice && groups[k].study == groups[i].study &&
                        groups[k].reference == groups[i].reference &&
                        choiceOf(*advices[k].row) == choiceOf(*advices[i].row) &&
                        advices[k].good_enough == advices[i].good_enough;
      if (!same) continue;
      said[k] = true;
      likewise.push_back(placeOf(groups[k]) + " (" + measuresOf(*advices[k].row) + ")");
    }
    paragraphs.push_back(advices[i].text + (likewise.empty() ? ""
                                            : advices[i].good_enough
                                                ? " The same choice in " + list(likewise) + "."
                                                : " It is the nearest, too, in " + list(likewise) + "."));
  }
  static constexpr std::array<const char*, 5> kWords = {"the model ", "an FEM mesh of ", "a loop of ",
                                                        "stored steps of ", "live frames of "};
  static constexpr std::array<const char*, 5> kNames = {"model", "mesh", "rate", "stored resolution",
                                                        "interval of live frames"};
  std::vector<std::string> choices, missed;
  for (std::size_t s = 0; s < kWords.size(); ++s) {
    const auto study = static_cast<AccuracyStudy>(s);
    const std::string choice = consensusOf(study, advices);
    if (choice == "lossless")
      choices.emplace_back("lossless storage");
    else if (!choice.empty())
      choices.push_back(kWords[s] + choice);
    else if (std::any_of(advices.begin(), advices.end(), [&](const Advice& advice) {
               return advice.is_choice && advice.row->study == study;
             }))
      missed.emplace_back(kNames[s]);
  }
  std::string sum;
  if (!choices.empty()) sum = "In sum, on this machine: " + list(choices) + ".";
  if (!missed.empty())
    sum += (sum.empty() ? "In sum: no " : " No ") + list(missed) +
           " can be recommended from these comparisons: none meets its condition against a comparator other "
           "than "
           "its own law.";
  if (!sum.empty()) paragraphs.push_back(sum);
  return paragraphs;
}

std::string findingOf(AccuracyStudy study, const AccuracyRows& rows) {
  for (const RowGroup& group : groupsOf(rows)) {
    if (group.study != study) continue;
    const Advice advice = adviceFor(group);
    if (advice.row == nullptr) continue;
    const AccuracyRow& row = *advice.row;
    if (advice.is_choice && !advice.good_enough)
      return missOf(row) > 1 ? "None passes: " + choiceOf(row) + " comes nearest, " + sig(missOf(row), 2) +
                                   " times the limit"
                             : "None passes but " + choiceOf(row) + ", the comparator";
    switch (study) {
      case AccuracyStudy::kModel:
        return choiceOf(row) + ": " + forceText(errorOf(row)) + " of error for " + timeText(priceOf(row)) +
               " a tick";
      case AccuracyStudy::kMesh:
        return "FEM of " + choiceOf(row) + ": " + forceText(errorOf(row)) + " of error for " +
               timeText(costOf_ns(row).value_or(CostInterval{}).value) +
               (row.precompute_s ? " before the lesson" : " a tick");
      case AccuracyStudy::kRate:
        return choiceOf(row) + " is enough: " + forceText(errorOf(row)) + " of error for " +
               sig(100 * row.cpu_share.value_or(0), 2) + " % of a core";
      case AccuracyStudy::kStorage:
        return "Steps of " + choiceOf(row) + ": " + sig(row.bytes_per_sample.value_or(0), 3) +
               " bytes a sample for " + forceText(errorOf(row)) + " of error";
      case AccuracyStudy::kLive:
        return "Frames of " + choiceOf(row) + ": " + sig(row.latency_p99_ms.value_or(0), 3) + " ms" +
               " late (p99) for " + sig(row.bytes_per_s.value_or(0) * 1e-3, 3) + " kB/s";
    }
  }
  return {};
}

double missOf(const AccuracyRow& row) {
  const double noticed_N = row.noticeable_n.value_or(0);
  // the upper end of the error's interval
  const double error_N = errorOf(row) + row.rms_error_spread_n.value_or(0);
  const auto share = [](double force_N, double limit_N) {
    return limit_N > 0 ? force_N / limit_N : force_N > 0 ? kUnmeasured : 0.0;
  };
  // a step in time is felt by its own size, not as a share of the force
  const double step = row.max_step_n.value_or(0) / kNoticeableStep_N;
  switch (row.study) {
    case AccuracyStudy::kModel:
      return std::max(share(error_N, noticed_N), step);
    case AccuracyStudy::kRate:
      return std::max(
          {share(error_N, noticed_N), step, kStiffnessMargin / row.stiffness_margin.value_or(kUnmeasured)});
    case AccuracyStudy::kMesh:
      return share(error_N, noticed_N);
    case AccuracyStudy::kStorage:
      return share(error_N, kStorageShare * noticed_N);
    case AccuracyStudy::kLive:
      return row.latency_p99_ms.value_or(kUnmeasured) / kMostLatency_ms;
  }
  return kUnmeasured;
}

}  // namespace needlelab
