/// Rows that may be compared, and those of them that nothing beats in both cost and error.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"

namespace needlelab {

/// The cost of a row: processor time for a millisecond of the lesson, which is one tick at 1 kHz. In ns.
/// Nothing when it was not measured.
std::optional<double> costOf_ns(const AccuracyRow& row);

/// The choice that a row stands for, as text: "VOIGT", "10 kHz", "1 µm", "lossless", "20 ms", "2,000 nodes".
std::string choiceOf(const AccuracyRow& row);

/// Rows of one study, scene and reference (and model, unless the model is varied), in their order.
struct RowGroup {
  AccuracyStudy study;
  std::string scene, reference, model;  ///< model empty in study `model`
  std::vector<const AccuracyRow*> rows;
  std::vector<std::string> names;  ///< of the rows: choiceOf, with the variant where that is not unique

  /// Whether it compares different choices that advise; else it is one of them beside its reference, or an
  /// extrapolation.
  [[nodiscard]] bool compares() const;
};
/// In order of first appearance. The rows must outlive the groups.
std::vector<RowGroup> groupsOf(const AccuracyRows& rows);

/// A choice in two measures, both of which should be small.
struct CostError {
  double cost = 0, error = 0;
};
/// Which of `points` no other beats: none has less of one and not more of the other. Points that are equal in
/// both are on it together. A point with a measure that is not finite never is.
std::vector<bool> paretoFront(const std::vector<CostError>& points);

/// The front of a group in cost and rms error; a row that lacks one of them is not on it,
/// nor is the finest mesh, whose error is 0 by definition.
std::vector<bool> paretoFront(const RowGroup& group);

/// The row of a group that the rule of its study takes, and why.
struct Advice {
  const AccuracyRow* row = nullptr;  ///< null: nothing can be said
  bool is_choice = false;            ///< the group compares different choices
  bool good_enough = false;          ///< it meets the study's condition, else it is the nearest to it
  std::string text;                  ///< one paragraph
};

/// The rules, among the rows that fit their rate:
/// - model: the cheapest whose rms error nobody notices (`noticeable_n`) and whose force, where that is
/// measured,
///   never steps by more; else the least error.
/// - rate: as for a model, and theory must allow twice the scene's stiffness (`stiffness_margin`).
/// - mesh: the coarsest whose rms error nobody notices; else the finest.
/// - storage: the fewest bytes whose rms error is at most a tenth of a noticeable force.
/// - live: the least bandwidth whose p99 latency is below 25 ms, half of the 50 ms of tests/bench/README.md
/// (server and
///   network need the rest); else the least latency.
Advice adviceFor(const RowGroup& group);

/// A paragraph for each group, and one at the end that puts the choices together. Empty without rows.
std::vector<std::string> recommendation(const AccuracyRows& rows);

/// The finding of a study in a line, for a picture's title; empty without rows of it.
std::string findingOf(AccuracyStudy study, const AccuracyRows& rows);

}  // namespace needlelab
