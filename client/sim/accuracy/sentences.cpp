#include "client/sim/accuracy/report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "client/sim/accuracy/study.h"
#include "client/sim/tools/hand_thresholds.h"

namespace needlelab {
namespace {

using Rows = std::vector<const AccuracyRow*>;

Rows chosen(const AccuracyRows& rows, const std::function<bool(const AccuracyRow&)>& choose) {
  Rows found;
  for (const AccuracyRow& row : rows)
    if (choose(row)) found.push_back(&row);
  return found;
}

double error_mN(const AccuracyRow& row) {
  return 1e3 * row.error_N->mean;
}

// ascending
void sort(Rows& rows, double (*by)(const AccuracyRow&)) {
  std::stable_sort(rows.begin(), rows.end(),
                   [by](const AccuracyRow* a, const AccuracyRow* b) { return by(*a) < by(*b); });
}

double medianError_mN(const AccuracyRows& rows, double rate_hz, double encoder_m) {
  Rows at = chosen(rows, [&](const AccuracyRow& row) {
    return row.comparator == Comparator::kVerification && row.error_N && row.rate_hz == rate_hz &&
           row.encoder_m == encoder_m;
  });
  if (at.empty()) return 0;
  sort(at, error_mN);
  return error_mN(*at[at.size() / 2]);
}

std::string verificationSentence(const AccuracyRows& rows) {
  Rows main = chosen(rows, [](const AccuracyRow& row) {
    return row.comparator == Comparator::kVerification && isMain(row) && row.encoder_m && row.error_N;
  });
  if (main.empty()) return {};
  sort(main, error_mN);
  const double now_mN = medianError_mN(rows, kStationRate_hz, kStationEncoder_m);
  const double rate_mN = medianError_mN(rows, 4 * kStationRate_hz, kStationEncoder_m);
  const double encoder_mN = medianError_mN(rows, kStationRate_hz, 1e-6);
  const double both_mN = medianError_mN(rows, 4 * kStationRate_hz, 1e-6);
  constexpr double kAlike = 0.8;
  const char* advice = rate_mN < kAlike * encoder_mN   ? "the rate first"
                       : encoder_mN < kAlike * rate_mN ? "the encoder first"
                                                       : "both or for neither";
  std::string text = fmt::format(
      "At 1 kHz and 10 µm the engine keeps {} laws within {:.2g} mN ({}) to {:.2g} mN ({}) of their "
      "formulas. The median, {:.2g} mN, falls to {:.2g} mN at 4 kHz, to {:.2g} mN with 1 µm, to {:.2g} mN "
      "with both: pay for {}.",
      main.size(), error_mN(*main.front()), nameOf(*main.front()), error_mN(*main.back()),
      nameOf(*main.back()), now_mN, rate_mN, encoder_mN, both_mN, advice);
  // laws that become worse with a faster loop
  for (const AccuracyRow* row : main)
    for (const AccuracyRow& fast : rows)
      if (fast.comparator == Comparator::kVerification && fast.model == row->model &&
          fast.variant == row->variant && fast.rate_hz == 4 * kStationRate_hz &&
          fast.encoder_m == kStationEncoder_m && error_mN(fast) > 2 * error_mN(*row))
        text += fmt::format(" {} gets worse with the rate alone ({:.2g} mN).", nameOf(*row), error_mN(fast));
  return text;
}

// FEM rows with this many stations, coarsest mesh first
Rows meshesOf(const AccuracyRows& rows, double stations) {
  return chosen(rows, [stations](const AccuracyRow& row) {
    return row.comparator == Comparator::kRefinement && row.error_N && row.stations == stations && row.nodes;
  });
}

std::vector<double> stationsOf(const AccuracyRows& rows) {
  std::vector<double> stations;
  for (const AccuracyRow& row : rows)
    if (row.comparator == Comparator::kRefinement && row.stations &&
        std::find(stations.begin(), stations.end(), *row.stations) == stations.end())
      stations.push_back(*row.stations);
  std::sort(stations.begin(), stations.end());
  return stations;
}

std::string refinementSentence(const AccuracyRows& rows) {
  const std::vector<double> stations = stationsOf(rows);
  if (stations.empty()) return {};
  const Rows most = meshesOf(rows, stations.back()), least = meshesOf(rows, stations.front());
  if (most.empty() || least.empty()) return {};
  const AccuracyRow &coarse = *most.front(), &fine = *most.back(), &few = *least.back();
  return fmt::format(
      "{:.0f} stations on {:.0f} nodes miss the finest mesh by {:.0f} mN, on {:.0f} nodes by {:.0f} mN; "
      "{:.0f} stations on {:.0f} nodes by {:.0f} mN: buy {} first, but both are needed.",
      *coarse.stations, *coarse.nodes, error_mN(coarse), *fine.nodes, error_mN(fine), *few.stations,
      *few.nodes, error_mN(few), error_mN(few) < error_mN(coarse) ? "nodes" : "stations");
}

std::string validationSentence(const AccuracyRows& rows) {
  std::vector<std::string> scenes;
  for (const AccuracyRow& row : rows)
    if (row.comparator == Comparator::kValidation && row.error_N &&
        std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end())
      scenes.push_back(row.scene);
  if (scenes.empty()) return {};
  std::string text;
  std::size_t beaten = 0;
  for (const std::string& scene : scenes) {
    Rows models = chosen(rows, [&](const AccuracyRow& row) {
      return row.comparator == Comparator::kValidation && row.scene == scene && row.error_N && !row.line;
    });
    Rows lines = chosen(rows, [&](const AccuracyRow& row) {
      return row.comparator == Comparator::kValidation && row.scene == scene && row.error_N && row.line;
    });
    if (models.empty() || lines.empty()) continue;
    sort(models, error_mN);
    sort(lines, error_mN);
    if (error_mN(*lines.front()) <= error_mN(*models.front())) ++beaten;
    text +=
        fmt::format("{}{} {:.0f}/{:.0f}", text.empty() ? "" : ", ",
                    scene.find("beyond") != std::string::npos ? "beyond half of it"
                                                              : scene.substr(0, scene.find_first_of(": ")),
                    error_mN(*models.front()), error_mN(*lines.front()));
  }
  return fmt::format(
      "{} questions to curves of one specimen each cannot rank models: in {} of them a line drawn through "
      "the data is nearer than every model (best model/line in mN: {}). Buy no model for its place here.",
      scenes.size(), beaten, text);
}

std::string replaySentence(const AccuracyRows& rows) {
  Rows all = chosen(
      rows, [](const AccuracyRow& row) { return row.comparator == Comparator::kReplay && row.error_N; });
  if (all.empty()) return {};
  sort(all, error_mN);
  const auto share = [](const AccuracyRow& row) { return 100 * row.beyond.value_or(0); };
  const auto within =
      std::count_if(all.begin(), all.end(), [&](const AccuracyRow* row) { return share(*row) < 5; });
  return fmt::format(
      "In {} recorded hands a loop of 1 kHz with 10 µm costs {:.2g} mN ({}) to {:.2g} mN ({}), and {:.1f} % "
      "and {:.1f} % of their ticks are off by more than a hand may notice. {} of {} models stay below 5 % of "
      "the ticks: these need no faster loop.",
      all.front()->error_N->count, error_mN(*all.front()), nameOf(*all.front()), error_mN(*all.back()),
      nameOf(*all.back()), share(*all.front()), share(*all.back()), within, all.size());
}

}  // namespace

bool isMain(const AccuracyRow& row) {
  if (row.comparator != Comparator::kVerification) return true;
  return row.rate_hz.value_or(kStationRate_hz) == kStationRate_hz &&
         row.encoder_m.value_or(kStationEncoder_m) == kStationEncoder_m;
}

std::string sentenceOf(Comparator comparator, const AccuracyRows& rows) {
  switch (comparator) {
    case Comparator::kVerification:
      return verificationSentence(rows);
    case Comparator::kRefinement:
      return refinementSentence(rows);
    case Comparator::kValidation:
      return validationSentence(rows);
    case Comparator::kReplay:
      return replaySentence(rows);
  }
  return {};
}

std::string femSentence(const AccuracyRows& rows) {
  const std::vector<double> stations = stationsOf(rows);
  if (stations.empty()) return {};
  // on the finest mesh that both have
  const Rows few = meshesOf(rows, stations.front()), many = meshesOf(rows, stations.back());
  if (few.empty() || many.empty()) return {};
  const double nodes = std::min(*few.back()->nodes, *many.back()->nodes);
  const auto on = [nodes](const AccuracyRow* row) { return *row->nodes == nodes; };
  const auto found_few = std::find_if(few.begin(), few.end(), on),
             found_many = std::find_if(many.begin(), many.end(), on);
  if (found_few == few.end() || found_many == many.end()) return {};
  const AccuracyRow &a = **found_few, &b = **found_many;
  if (!a.time || !b.time) return {};
  const auto tick = [](const AccuracyRow& row) {
    return row.instructions ? fmt::format("{:.0f} instructions", *row.instructions)
                            : fmt::format("{:.1f} µs", 1e-3 * row.time->p50_ns);
  };
  return fmt::format(
      "A tick of FEM pays for stations, not for nodes: on {:.0f} nodes {:.0f} stations take {} and miss "
      "{:.0f} mN, {:.0f} take {} and miss {:.0f} mN. A finer mesh costs seconds before the lesson and "
      "nothing in it.",
      nodes, *a.stations, tick(a), error_mN(a), *b.stations, tick(b), error_mN(b));
}

std::string costSentence(const AccuracyRows& rows) {
  // A model's tick is listed in several comparators, at the same cost.
  Rows timed = chosen(rows, [](const AccuracyRow& row) { return row.time.has_value() && !row.line; });
  if (timed.empty()) return {};
  sort(timed, [](const AccuracyRow& row) { return row.time->p50_ns; });
  double worst_ns = 0;
  const AccuracyRow* stiffest = timed.front();
  for (const AccuracyRow* row : timed) {
    worst_ns = std::max(worst_ns, row->time->p99_ns);
    if (row->margin.value_or(1e9) < stiffest->margin.value_or(1e9)) stiffest = row;
  }
  const auto label = [](const AccuracyRow& row) {
    return row.stations ? fmt::format("{} of {:.0f} stations", row.model, *row.stations) : nameOf(row);
  };
  const AccuracyRow &least = *timed.front(), &most = *timed.back();
  std::string text = fmt::format(
      "In the station's own loop a tick takes {:.2g} to {:.2g} µs in the median, and 99 % take "
      "below {:.2g} µs, {:.1f} % of the millisecond: none asks for a faster computer. ",
      1e-3 * least.time->p50_ns, 1e-3 * most.time->p50_ns, 1e-3 * worst_ns, 1e-4 * worst_ns);
  // State an order only if the printed ranges do not overlap; instruction counts repeat exactly.
  text += least.time->p999_ns < most.time->p50_ns
              ? fmt::format("{} is quicker than {}.", label(least), label(most))
              : std::string("The ranges overlap, so time does not rank them.");
  Rows counted = chosen(rows, [](const AccuracyRow& row) { return row.instructions && !row.line; });
  if (!counted.empty()) {
    sort(counted, [](const AccuracyRow& row) { return *row.instructions; });
    text += fmt::format(" Instructions: {:.0f} ({}) to {:.0f} ({}).", *counted.front()->instructions,
                        label(*counted.front()), *counted.back()->instructions, label(*counted.back()));
  }
  if (stiffest->margin) text += fmt::format(" K margin: {:.2g} ({}).", *stiffest->margin, label(*stiffest));
  return text;
}

}  // namespace needlelab
