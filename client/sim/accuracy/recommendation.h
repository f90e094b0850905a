/// What to choose, in words, computed from the rows of the report and nothing else.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/pareto.h"

namespace needlelab {

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
/// - storage: the fewest bytes whose rms error is at most a tenth of what is noticed.
/// - live: the least bandwidth whose p99 latency is below 25 ms, half of the 50 ms of DESIGN §12 (server and
///   network need the rest); else the least latency.
Advice adviceFor(const RowGroup& group);

/// A paragraph for each group, and one at the end that puts the choices together. Empty without rows.
std::vector<std::string> recommendation(const AccuracyRows& rows);

/// The finding of a study in a line, for a picture's title; empty without rows of it.
std::string findingOf(AccuracyStudy study, const AccuracyRows& rows);

}  // namespace needlelab
