#include "client/sim/accuracy/pareto.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace needlelab {
namespace {

std::string number(double value, const char* unit) {
  char text[48];
  std::snprintf(text, sizeof text, "%.4g %s", value, unit);
  return text;
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
         (row.study == AccuracyStudy::kModel || group.model == row.model);
}

}  // namespace

std::optional<double> costOf_ns(const AccuracyRow& row) {
  if (row.study == AccuracyStudy::kRate)
    return row.cpu_share ? std::optional(*row.cpu_share * 1e6) : std::nullopt;
  return row.median_ns;
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

std::vector<bool> paretoFront(const std::vector<CostError>& points) {
  const auto beats = [](const CostError& a, const CostError& b) {
    return a.cost <= b.cost && a.error <= b.error && (a.cost < b.cost || a.error < b.error);
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

std::vector<bool> paretoFront(const RowGroup& group) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<CostError> points;
  for (const AccuracyRow* row : group.rows) {
    // the finest mesh has no error by definition: it is no choice that beats others
    const bool comparator = row->study == AccuracyStudy::kMesh && row->rms_error_n == 0.0;
    points.push_back(
        {costOf_ns(*row).value_or(kNone), comparator ? kNone : row->rms_error_n.value_or(kNone)});
  }
  return paretoFront(points);
}

}  // namespace needlelab
