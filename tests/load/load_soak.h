/// A long run with faults, judged: nothing lost, the server's memory and file handles flat.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/load/load_run.h"
#include "tests/soak/soak_judge.h"

namespace needlelab::test {

/// In the order of a table. Memory and handles are those of the server that lived last, after a warm-up of a
/// quarter of its life, at most 5 min: each restart begins anew with both.
std::vector<Finding> judgeLoad(const LoadResult& result, const SoakLimits& limits = {});

/// samples.csv (a row a second), table.txt (the verdict is its last line), load.json, soak.png (where gnuplot
/// is) into `out`, which is made. Errors: kFailed.
Status writeSoak(const LoadResult& result, const std::vector<Finding>& findings,
                 const std::filesystem::path& out);

}  // namespace needlelab::test
