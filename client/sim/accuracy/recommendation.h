/// Groups of comparable rows, and their Pareto front in cost and error.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"

namespace needlelab {

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

/// The row of a group that its study's rule picks, and the reason.
struct Advice {
  const AccuracyRow* row = nullptr;  ///< null: nothing can be said
  bool is_choice = false;            ///< the group compares different choices
  bool good_enough = false;          ///< it meets the study's condition, else it is the nearest to it
  std::string text;                  ///< one paragraph
  /// It counts for the sum: what meets no condition does not.
  [[nodiscard]] bool votes() const { return is_choice && good_enough; }
};

/// The rules, among the rows that fit their rate and whose comparator is not of their own law. An error
/// passes when its interval does: rms plus spread.
/// - model: the cheapest row with an error below `noticeable_n` and force steps (where measured) below
///   kNoticeableStep_N. Costs
///   within each other's noise count as equal; then the fewest instructions, then the least error decide.
/// - rate: the slowest with error and steps below the same for which theory allows twice the
/// scene's
///   stiffness (`stiffness_margin`).
/// - mesh: the coarsest with an error below `noticeable_n`.
/// - storage: the fewest bytes with an error of at most a tenth of a noticeable force.
/// - live: the least bandwidth with a p99 latency below 25 ms, half of the 50 ms of tests/bench/README.md
///   (server and network need the rest).
/// Where none passes, the row of the least error (live: latency) is named with the factor by which it misses
/// the limit, and does not vote.
Advice adviceFor(const RowGroup& group);

/// By which factor a row misses its study's condition, at most 1 where it meets it. Infinite without an
/// error.
double missOf(const AccuracyRow& row);

/// A paragraph for each group, and one at the end that puts the choices together. Empty without rows.
std::vector<std::string> recommendation(const AccuracyRows& rows);

/// The finding of a study in a line, for a picture's title; empty without rows of it.
std::string findingOf(AccuracyStudy study, const AccuracyRows& rows);

}  // namespace needlelab
