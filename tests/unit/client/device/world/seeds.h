/// Runs that a seed decides: playing many, playing those again that once failed, and finding a planted bug.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "common/base/planted_bug.h"

namespace needlelab::test {

/// The bug that this program has; none at first. A test that plants one takes it away again.
std::optional<PlantedBug>& bugHere();

/// A kind of run.
struct SeededRuns {
  std::string name;                                         ///< of its tests, e.g. "FalconSeeds"
  std::function<std::string(std::uint64_t seed)> brokenBy;  ///< plays it; the first broken rule, or nothing
  std::function<std::string(std::uint64_t seed)> textOf;    ///< what happens in it, for a person
};

/// How to play a seed again.
std::string again(const SeededRuns& runs, std::uint64_t seed);
/// Seeds from 1 on, or the only one that NEEDLELAB_SEED names. Each broken rule is a failure of the test; at
/// most five.
void playSeeds(const SeededRuns& runs, std::uint64_t count);
/// The seeds of a file: one a line, each with its reason.
void playRegressions(const SeededRuns& runs, const std::string& file);
/// One of the seeds 1 … `most` breaks a rule; prints and returns the first. None does: a failure of the test,
/// and 0. `what`: the bug, for a person.
std::uint64_t catchIn(const std::string& what, const std::function<std::string(std::uint64_t seed)>& brokenBy,
                      std::uint64_t most);
/// Plants the bug: one of the seeds 1 … `most` breaks a rule, and without the bug it does not.
void catchBug(const SeededRuns& runs, PlantedBug bug, std::uint64_t most);

}  // namespace needlelab::test
