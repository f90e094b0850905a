#include "tests/powercut/campaign.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>

namespace needlelab::test {
namespace {

// thousands of small folders: in memory if possible
[[maybe_unused]] const bool in_memory =
    ::access("/dev/shm", W_OK) == 0 && ::setenv("TMPDIR", "/dev/shm", 0) == 0;

constexpr std::string_view kBad = ", bad in ";

}  // namespace

bool plantedRun() {
  return std::getenv("NEEDLELAB_PLANT") != nullptr;
}

void report(const std::string& name, const CutCounts& c) {
  const auto number = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  std::printf(
      "%s: %llu runs, %llu cuts (%llu in a commit, %llu in a checkpoint), %llu outcomes, %llu cut again, bad "
      "in %llu\n",
      name.c_str(), number(c.runs), number(c.cuts), number(c.in_commit), number(c.in_checkpoint),
      number(c.outcomes), number(c.double_cuts), number(c.bad));
  if (!c.first.empty()) std::printf("  first: %s\n", c.first.c_str());
  std::fflush(stdout);
}

void cutLog(const DiskLog& log, std::size_t first, std::size_t last, int cuts, std::uint64_t seed,
            const CutJudge& judge, CutCounts& counts) {
  Random random(seed ^ 0x9D15C0ull);
  std::vector<std::size_t> instants;
  for (int i = 0; i < cuts; ++i) instants.push_back(first + random.below(last - first + 1));
  std::sort(instants.begin(), instants.end());
  DiskReplay replay(log);
  ++counts.runs;
  for (const std::size_t instant : instants) {
    replay.advanceTo(instant);
    ++counts.cuts;
    // a commit writes the log and syncs it; a checkpoint writes the database and syncs it
    if (replay.hasUnsynced(".db"))
      ++counts.in_checkpoint;
    else if (replay.hasUnsynced("-wal"))
      ++counts.in_commit;
    for (int o = 0; o < kOutcomes; ++o) {
      const auto outcome = static_cast<CutOutcome>(o);
      const TempFolder after;
      replay.cut(outcome, random, after.path());
      ++counts.outcomes;
      const std::string wrong = judge(after.path(), instant, random);
      if (wrong.empty()) continue;
      if (++counts.bad == 1)
        counts.first = "seed " + std::to_string(seed) + ", cut before call " + std::to_string(instant) +
                       " of " + std::to_string(log.events().size()) + ", " + nameOf(outcome) + ": " + wrong;
    }
  }
}

PlantedRun runPlanted(const std::string& bug, const std::string& filter) {
  const std::string command = "NEEDLELAB_LONG= NEEDLELAB_PLANT=" + bug + " /proc/" +
                              std::to_string(::getpid()) +
                              "/exe --gtest_also_run_disabled_tests --gtest_filter='" + filter + "' 2>&1";
  PlantedRun run;
  FILE* const pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return run;
  std::array<char, 4096> text{};
  while (std::fgets(text.data(), text.size(), pipe) != nullptr) run.said += text.data();
  const int status = ::pclose(pipe);
  // the campaign must report a finding: a crash or an empty filter does not count
  for (std::size_t at = 0; (at = run.said.find(kBad, at)) != std::string::npos; ++at) {
    const std::size_t begin = run.said.rfind('\n', at) + 1;
    std::printf("with %s: %s\n", bug.c_str(),
                run.said.substr(begin, run.said.find('\n', at) - begin).c_str());
    run.failed |= std::strtoull(run.said.c_str() + at + kBad.size(), nullptr, 10) > 0;
  }
  run.failed &= WIFEXITED(status) && WEXITSTATUS(status) == 1;
  return run;
}

}  // namespace needlelab::test
