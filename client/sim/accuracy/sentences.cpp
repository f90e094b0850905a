#include "client/sim/accuracy/report.h"

#include <fmt/core.h>

#include <algorithm>
#include <functional>
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

// Of the laws with a formula, at the station's encoder.
Rows verified(const AccuracyRows& rows, double rate_hz) {
  Rows found = chosen(rows, [rate_hz](const AccuracyRow& row) {
    return row.comparator == Comparator::kVerification && row.error_N && row.rate_hz == rate_hz &&
           row.encoder_m == kStationEncoder_m;
  });
  sort(found, error_mN);
  return found;
}

std::string verificationSentence(const AccuracyRows& rows) {
  constexpr double kTimes = 4;
  const Rows now = verified(rows, kStationRate_hz), fast = verified(rows, kTimes * kStationRate_hz);
  if (now.empty() || fast.empty()) return {};
  const auto below = std::count_if(
      now.begin(), now.end(), [](const AccuracyRow* row) { return row->error_N->mean < kNoticeableStep_N; });
  double delay_s = 0;
  for (const AccuracyRow* row : now) delay_s = std::max(delay_s, row->delay_s.value_or(0));
  std::string text = fmt::format(
      "At 1 kHz the laws miss {:.2g} to {:.2g} mN between jumps, {} of {} less than the {:.1f} mN that a hand "
      "notices, and a jump is at most {:.2g} ms late; {:g} kHz takes the median from {:.2g} to {:.2g} mN",
      error_mN(*now.front()), error_mN(*now.back()), below, now.size(), 1e3 * kNoticeableStep_N,
      1e3 * delay_s, kTimes, error_mN(*now[now.size() / 2]), error_mN(*fast[fast.size() / 2]));
  // laws that become worse with a faster loop
  for (const AccuracyRow* slow : now)
    for (const AccuracyRow* row : fast)
      if (nameOf(*row) == nameOf(*slow) && error_mN(*row) > 2 * error_mN(*slow))
        text += fmt::format(", but {} to {:.2g} mN", nameOf(*row), error_mN(*row));
  return text + ".";
}

std::string refinementSentence(const AccuracyRows& rows) {
  Rows meshes = chosen(rows, [](const AccuracyRow& row) {
    return row.comparator == Comparator::kRefinement && row.error_N && row.stations && row.nodes;
  });
  if (meshes.empty()) return {};
  sort(meshes, error_mN);
  const AccuracyRow &best = *meshes.front(), &worst = *meshes.back();
  std::string text = fmt::format("FEM: {:.0f} stations on {:.0f} nodes", *best.stations, *best.nodes);
  if (best.prepare_s) text += fmt::format(", {:.2g} s before the lesson", *best.prepare_s);
  if (best.time) text += fmt::format(" and {:.2g} µs a tick", 1e-3 * best.time->p50_ns);
  text += fmt::format(", miss {:.0f} mN", error_mN(best));
  // fewer stations, each number on its best mesh
  double fewer = *best.stations;
  for (const AccuracyRow* row : meshes)
    if (*row->stations < fewer) {
      fewer = *row->stations;
      text += fmt::format(", {:.0f} stations {:.0f} mN", fewer, error_mN(*row));
    }
  if (worst.greatest_N)
    text += fmt::format("; {:.0f} stations on {:.0f} nodes miss up to {:.1f} N, {}", *worst.stations,
                        *worst.nodes, *worst.greatest_N, worst.greatest_at);
  return text + ".";
}

}  // namespace

bool isMain(const AccuracyRow& row) {
  if (row.comparator != Comparator::kVerification) return true;
  return row.rate_hz.value_or(kStationRate_hz) == kStationRate_hz &&
         row.encoder_m.value_or(kStationEncoder_m) == kStationEncoder_m;
}

std::string sentenceOf(Comparator comparator, const AccuracyRows& rows) {
  if (comparator == Comparator::kVerification) return verificationSentence(rows);
  if (comparator == Comparator::kRefinement) return refinementSentence(rows);
  return {};
}

}  // namespace needlelab
