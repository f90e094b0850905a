/// A run as JSON and as text, and the verdict on a long run with faults.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/load/load_run.h"
#include "tests/soak/soak_judge.h"

namespace needlelab::test {

nlohmann::ordered_json loadJson(const LoadResult& result);
/// One line per field; the last line is the verdict.
std::string loadText(const LoadResult& result);

// The verdict on a long run with faults: nothing lost, the server's memory and file handles flat.

/// What counts is how long the last server lives after its warm-up; with faults, kills stop early
/// (kKillShare).
SoakForm soakForm(const LoadOptions& options);

/// In table order. Memory and handles are those of the last server process, after a warm-up of ten minutes:
/// both start over with each restart.
std::vector<Finding> judgeLoad(const LoadResult& result, const SoakLimits& limits = {});

/// Creates `out` and writes samples.csv (one row per second), table.txt (the verdict is its last line) and
/// load.json. Errors: kFailed.
Status writeSoak(const LoadResult& result, const std::vector<Finding>& findings,
                 const std::filesystem::path& out);

}  // namespace needlelab::test
