/// What each study's rows recommend, by the study's rule, in numbers and in words.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/row_group.h"

namespace needlelab {

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
///   kNoticeableStep_N. Costs within each other's noise count as equal; then the fewest instructions, then
///   the least error decide.
/// - rate: the slowest with error and steps below the same for which theory allows twice the scene's
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
