/// Groups of comparable rows, and their Pareto front in cost and error.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"

namespace needlelab {

/// The cost of a row: processor time for a millisecond of the lesson, which is one tick at 1 kHz. In ns.
/// Empty when it was not measured.
std::optional<double> costOf_ns(const AccuracyRow& row);

/// The choice that a row stands for, as text: "VOIGT", "10 kHz", "1 µm", "lossless", "20 ms", "2,000 nodes".
std::string choiceOf(const AccuracyRow& row);

/// Rows of one study, scene and reference (and model, unless the model is varied), in their order.
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
};
/// The Pareto front of `points`: no other point has less of one measure and not more of the other. Points
/// that are equal in both measures are on the front together. A point with a non-finite measure is never on
/// the front.
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
};

/// The rules, among the rows that fit their rate:
/// - model: the cheapest row with an rms error and a force step (where measured) below `noticeable_n`;
///   otherwise the least error.
/// - rate: as for a model, and theory must allow twice the scene's stiffness (`stiffness_margin`).
/// - mesh: the coarsest with an rms error below `noticeable_n`; otherwise the finest.
/// - storage: the fewest bytes with an rms error of at most a tenth of a noticeable force.
/// - live: the least bandwidth with a p99 latency below 25 ms, half of the 50 ms of tests/bench/README.md
///   (server and network need the rest); otherwise the least latency.
Advice adviceFor(const RowGroup& group);

/// A paragraph for each group, and one at the end that puts the choices together. Empty without rows.
std::vector<std::string> recommendation(const AccuracyRows& rows);

/// The finding of a study in a line, for a picture's title; empty without rows of it.
std::string findingOf(AccuracyStudy study, const AccuracyRows& rows);

}  // namespace needlelab
