/// Groups of comparable rows, and their Pareto front in cost and error.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"

namespace needlelab {

/// Stands for a measure that a row does not have: worse than all others.
inline constexpr double kUnmeasured = std::numeric_limits<double>::infinity();

/// The cost of a row with the noise of its runs: processor time for a millisecond of the lesson, which is one
/// tick at 1 kHz; of a mesh whose compliance is made before the lesson, the time of making it. In ns. Empty
/// when it was not measured; without an interval where only a median is known.
std::optional<CostInterval> costOf_ns(const AccuracyRow& row);

/// The choice that a row stands for, as text: "VOIGT", "10 kHz", "1 µm", "lossless", "20 ms", "2,000 nodes".
std::string choiceOf(const AccuracyRow& row);

/// Rows of one study, scene and reference (and model, unless the model is varied; of meshes also variant), in
/// their order.
struct RowGroup {
  AccuracyStudy study;
  std::string scene, reference, model;  ///< model empty in study `model`
  std::vector<const AccuracyRow*> rows;
  std::vector<std::string> names;  ///< of the rows: choiceOf, with the variant where that is not unique

  /// True if the group compares different choices that advise. False for a single choice beside its
  /// reference, and for an extrapolation.
  [[nodiscard]] bool compares() const;
};
/// In order of first appearance. The rows must outlive the groups.
std::vector<RowGroup> groupsOf(const AccuracyRows& rows);

/// A choice in two measures, both of which should be small.
struct CostError {
  double cost = 0, error = 0;
  double least_cost = cost, most_cost = cost;  ///< the noise of the cost's runs
  std::optional<double> instructions = {};     ///< decides where the noise does not
};
/// A row in these measures: cost by costOf_ns, rms error; infinite where it has none.
CostError pointOf(const AccuracyRow& row);
/// True if `a` costs less than `b`: their intervals do not meet, or they do and `a` takes fewer instructions.
/// Otherwise neither costs less.
bool costsLess(const CostError& a, const CostError& b);
/// The Pareto front of `points`: no other point has less of one measure and not more of the other, costs
/// compared by `costsLess`. Points that are equal in both measures are on the front together. A point with a
/// non-finite measure is never on the front.
std::vector<bool> paretoFront(const std::vector<CostError>& points);

/// The Pareto front of a group in cost and rms error. Rows that lack one of the two are excluded, and so is
/// the finest mesh, because its error is 0 by definition.
std::vector<bool> paretoFront(const RowGroup& group);

}  // namespace needlelab
