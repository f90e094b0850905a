/// Common parts of the power-cut tests: seeds, counts, and the run of the same program with a planted bug.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/powercut/disk_log.h"
#include "tests/support/run_form.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

/// True in the run started by `runPlanted`: a few cuts suffice.
bool plantedRun();

/// Results of a campaign of cuts.
struct CutCounts {
  std::uint64_t runs = 0, cuts = 0, outcomes = 0;
  std::uint64_t in_commit = 0, in_checkpoint = 0;  ///< cuts
  std::uint64_t bad = 0;                           ///< outcomes in which something was lost or wrong
  std::uint64_t double_cuts = 0;                   ///< … with a second cut during the repair
  std::string first;                               ///< the first bad one, in words
};
/// "name: 60 cuts (…), 300 outcomes, bad 0", to standard output and as a property of the test.
void report(const std::string& name, const CutCounts& counts);

/// Judges the state in `folder` after a cut before event `instant`; returns a message if something is wrong.
using CutJudge =
    std::function<std::string(const std::filesystem::path& folder, std::size_t instant, Random& random)>;

/// Cuts a log at `cuts` random instants from `first` to `last`, each with every outcome, and judges each.
/// `seed` identifies the run in messages.
void cutLog(const DiskLog& log, std::size_t first, std::size_t last, int cuts, std::uint64_t seed,
            const CutJudge& judge, CutCounts& counts);

/// Runs the tests of `filter` again in a new process with a planted bug. Returns whether they failed, and
/// their output.
struct PlantedRun {
  bool failed = false;
  std::string said;
};
PlantedRun runPlanted(const std::string& bug, const std::string& filter);

}  // namespace needlelab::test
