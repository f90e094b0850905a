/// Runs determined by a seed: playing many, replaying those that failed earlier, and finding a planted bug.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "common/base/planted_bug.h"

namespace needlelab::test {

/// The bug planted in this program; at first none. A test that plants one removes it again.
std::optional<PlantedBug>& bugHere();

/// A kind of run.
struct SeededRuns {
  std::string name;                                         ///< of its tests, e.g. "FalconSeeds"
  std::function<std::string(std::uint64_t seed)> brokenBy;  ///< plays it; first broken rule, or empty
  std::function<std::string(std::uint64_t seed)> textOf;    ///< describes the run, readable
};

/// The command that replays a seed.
std::string again(const SeededRuns& runs, std::uint64_t seed);
/// Plays the seeds from 1 on, or only the one in NEEDLELAB_SEED. Each broken rule fails the test; stops after
/// five.
void playSeeds(const SeededRuns& runs, std::uint64_t count);
/// Plays the seeds of a file: one per line, each with its reason.
void playRegressions(const SeededRuns& runs, const std::string& file);
/// Expects that one of the seeds 1 … `most` breaks a rule; prints and returns the first. If none does, the
/// test fails and it returns 0. `what`: the bug, in words.
std::uint64_t catchIn(const std::string& what, const std::function<std::string(std::uint64_t seed)>& brokenBy,
                      std::uint64_t most);
/// Plants the bug: one of the seeds 1 … `most` must break a rule, and must not without the bug.
void catchBug(const SeededRuns& runs, PlantedBug bug, std::uint64_t most);

}  // namespace needlelab::test
