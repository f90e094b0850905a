/// A run as JSON and as text.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/program.h"
#include "common/base/result.h"
#include "tests/load/load_run.h"
#include "tests/load/own_server.h"

namespace needlelab {
std::span<const EmbeddedFile> embeddedLoadPlots();  ///< the .gp files of this folder
}  // namespace needlelab

namespace needlelab::test {

nlohmann::ordered_json loadJson(const LoadResult& result);
/// Some lines for a person; the last is the verdict.
std::string loadText(const LoadResult& result);

// Growth of a server from one station to a thousand: table, goals, picture.

struct GrowthGoals {
  std::size_t stations = 1000;
  double live_p99_ms = 50;
};

/// What `needlelab-load --json` said of each size, smallest first; the profile is of a run of its own at
/// the largest.
struct Growth {
  std::vector<nlohmann::ordered_json> runs;
  std::optional<Profile> profile;
  pid_t profiled_pid = 0;  ///< of the server: its first thread is the network's
  double profiled_s = 0;   ///< of the server's processor time, while it was looked at for `profile_span_s`
  double profile_span_s = 0;
  std::string why_no_profile;
  std::string commit;
};

struct GrowthVerdict {
  bool met = false;
  std::string text;
};
/// The goals of tests/bench/README.md, over all sizes; the largest must be that of the goal.
std::vector<GrowthVerdict> judgeGrowth(const Growth& growth, const GrowthGoals& goals = {});

/// Markdown: the table of sizes, goals, where the time goes, what limits next.
std::string growthText(const Growth& growth);
std::string growthJson(const Growth& growth);
/// Four panels over the number of stations. Errors: kFailed with gnuplot's words.
Status drawGrowth(const Growth& growth, const std::filesystem::path& png);

}  // namespace needlelab::test
