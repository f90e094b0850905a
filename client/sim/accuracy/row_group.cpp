#include "client/sim/accuracy/row_group.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

std::string number(double value, const char* unit) {
  return fmt::format("{:.4g} {}", value, unit);
}

std::string thousands(double value) {
  const std::string digits = std::to_string(std::llround(value));
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += ',';
    text += digits[i];
  }
  return text;
}

bool sameGroup(const RowGroup& group, const AccuracyRow& row) {
  return group.study == row.study && group.scene == row.scene && group.reference == row.reference &&
         (row.study == AccuracyStudy::kModel || group.model == row.model) &&
         // seconds before a lesson and seconds in each tick are not one price
         (row.study != AccuracyStudy::kMesh || group.rows.front()->variant == row.variant);
}

}  // namespace

std::optional<CostInterval> costOf_ns(const AccuracyRow& row) {
  if (row.study == AccuracyStudy::kRate && row.cost && row.rate_hz) {
    const double ticks = *row.rate_hz * 1e-3;  // in a millisecond
    const CostInterval& tick = row.cost->cost_ns;
    return CostInterval{tick.value * ticks, tick.low * ticks, tick.high * ticks};
  }
  if (row.cost) return row.cost->cost_ns;
  if (row.runs_ns) return row.runs_ns;
  if (row.study == AccuracyStudy::kRate) {
    if (!row.cpu_share) return std::nullopt;
    return CostInterval{*row.cpu_share * 1e6, *row.cpu_share * 1e6, *row.cpu_share * 1e6};
  }
  if (row.precompute_s) {
    const double once_ns = *row.precompute_s * 1e9;
    return CostInterval{once_ns, once_ns, once_ns};
  }
  if (!row.median_ns) return std::nullopt;
  // meshes are timed by single ticks: their spread is the noise
  const double high_ns =
      row.study == AccuracyStudy::kMesh ? row.p99_ns.value_or(*row.median_ns) : *row.median_ns;
  return CostInterval{*row.median_ns, *row.median_ns, std::max(*row.median_ns, high_ns)};
}

std::string choiceOf(const AccuracyRow& row) {
  switch (row.study) {
    case AccuracyStudy::kModel:
      return row.model.empty() ? row.variant : row.model;
    case AccuracyStudy::kMesh:
      return row.mesh_nodes ? thousands(*row.mesh_nodes) + " nodes" : row.variant;
    case AccuracyStudy::kRate:
      if (!row.rate_hz) return row.variant;
      return *row.rate_hz >= 1000 ? number(*row.rate_hz / 1000, "kHz") : number(*row.rate_hz, "Hz");
    case AccuracyStudy::kStorage:
      if (!row.quantum_m) return row.variant;
      return *row.quantum_m > 0 ? number(*row.quantum_m * 1e6, "µm") : "lossless";
    case AccuracyStudy::kLive:
      return row.frame_s ? number(*row.frame_s * 1e3, "ms") : row.variant;
  }
  return row.variant;
}

std::vector<RowGroup> groupsOf(const AccuracyRows& rows) {
  std::vector<RowGroup> groups;
  for (const AccuracyRow& row : rows) {
    RowGroup* found = nullptr;
    for (RowGroup& group : groups)
      if (sameGroup(group, row)) found = &group;
    if (found == nullptr) {
      groups.push_back({row.study,
                        row.scene,
                        row.reference,
                        row.study == AccuracyStudy::kModel ? std::string() : row.model,
                        {},
                        {}});
      found = &groups.back();
    }
    found->rows.push_back(&row);
  }
  for (RowGroup& group : groups)
    for (const AccuracyRow* row : group.rows) {
      const std::string choice = choiceOf(*row);
      const auto same = std::count_if(group.rows.begin(), group.rows.end(),
                                      [&](const AccuracyRow* other) { return choiceOf(*other) == choice; });
      group.names.push_back(same > 1 && !row->variant.empty() ? choice + " (" + row->variant + ")" : choice);
    }
  return groups;
}

bool RowGroup::compares() const {
  if (std::any_of(rows.begin(), rows.end(), [](const AccuracyRow* row) { return !row->advises; }))
    return false;
  return std::any_of(rows.begin(), rows.end(),
                     [&](const AccuracyRow* row) { return choiceOf(*row) != choiceOf(*rows.front()); });
}

bool costsLess(const CostError& a, const CostError& b) {
  if (a.most_cost < b.least_cost) return true;
  if (b.most_cost < a.least_cost) return false;
  return a.instructions && b.instructions && *a.instructions < *b.instructions;
}

std::vector<bool> paretoFront(const std::vector<CostError>& points) {
  const auto beats = [](const CostError& a, const CostError& b) {
    return !costsLess(b, a) && a.error <= b.error && (costsLess(a, b) || a.error < b.error);
  };
  const auto finite = [](const CostError& a) { return std::isfinite(a.cost) && std::isfinite(a.error); };
  std::vector<bool> front(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    front[i] = finite(points[i]);
    for (const CostError& other : points)
      if (finite(other) && beats(other, points[i])) front[i] = false;
  }
  return front;
}

CostError pointOf(const AccuracyRow& row) {
  const CostInterval cost = costOf_ns(row).value_or(CostInterval{kUnmeasured, kUnmeasured, kUnmeasured});
  // the ticks of all rates do the same work: fewer of them are fewer instructions
  return {cost.value, row.rms_error_n.value_or(kUnmeasured), cost.low, cost.high,
          row.study == AccuracyStudy::kRate ? row.rate_hz : row.instructions};
}

std::vector<bool> paretoFront(const RowGroup& group) {
  std::vector<CostError> points;
  for (const AccuracyRow* row : group.rows) {
    points.push_back(pointOf(*row));
    // the finest mesh has no error by definition: it does not beat others
    if (row->study == AccuracyStudy::kMesh && row->rms_error_n == 0.0) points.back().error = kUnmeasured;
  }
  return paretoFront(points);
}

}  // namespace needlelab
