// Hundreds of simulated lessons with a Virtuose. A seed decides what goes wrong, when, and who wakes first.
// The rules of VirtuoseRun hold in each. A failing seed is printed with the command that replays it; keep it
// in the file `virtuose_regressions`, with its reason.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "common/haptics/gate/force_gate.h"
#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"
#include "tests/unit/client/device/world/seeds.h"
#include "tests/unit/client/device/world/virtuose_run.h"

namespace needlelab::test {
namespace {

/// Of the short form; each planted bug must show within this many.
constexpr std::uint64_t kVirtuoseSeeds = 500;

std::string virtuoseBrokenBy(std::uint64_t seed, std::uint32_t hides = 0) {
  VirtuoseRun run(virtuosePlanOf(seed), hides);
  run.play();
  return run.broken();
}

SeededRuns virtuoseRuns() {
  return {"VirtuoseSeeds", [](std::uint64_t seed) { return virtuoseBrokenBy(seed); },
          [](std::uint64_t seed) { return textOf(virtuosePlanOf(seed)); }};
}

TEST(VirtuoseSeeds, everyRunKeepsTheRules) {
  playSeeds(virtuoseRuns(), longForm() ? 100'000 : kSanitized ? 50 : kVirtuoseSeeds);
}

TEST(VirtuoseSeeds, seedsThatOnceFailedKeepTheRules) {
  playRegressions(virtuoseRuns(), NEEDLELAB_WORLD "/virtuose_regressions");
}

TEST(VirtuoseSeeds, theSameSeedIsTheSameRunToTheBit) {
  // the program has a single stand-in, so runs are sequential
  const auto traceOf = [](std::uint64_t seed) {
    VirtuoseRun run(virtuosePlanOf(seed));
    run.play();
    EXPECT_GT(run.ticks(), 20u) << again(virtuoseRuns(), seed);
    return run.trace();
  };
  std::set<std::uint64_t> traces;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const std::uint64_t trace = traceOf(seed);
    EXPECT_EQ(traceOf(seed), trace) << again(virtuoseRuns(), seed);
    traces.insert(trace);
  }
  EXPECT_EQ(traces.size(), 10u);
}

TEST(VirtuoseSeeds, manyRunsLoseTheirDeviceAndFindItAgain) {
  std::uint64_t reconnections = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    VirtuoseRun run(virtuosePlanOf(seed));
    run.play();
    reconnections += run.reconnections();
  }
  EXPECT_GE(reconnections, 5u);
}

// ---- proof that the rules can be broken

TEST(VirtuoseSeeds, eachPlantedBugIsCaught) {
  for (const PlantedBug bug : {PlantedBug::kRetryNeverDoubles, PlantedBug::kNoKeepAlive,
                               PlantedBug::kOldConnectionKept, PlantedBug::kNoLastCommand})
    catchBug(virtuoseRuns(), bug, kVirtuoseSeeds);
}

TEST(VirtuoseSeeds, aDeviceThatConcealsItsConditionIsCaught) {
  for (const std::uint32_t flag : {kDeviceEmergencyStop, kDeviceReleased, kDevicePowerOff, kDeviceOverheated,
                                   kDeviceLost, kDeviceTrouble}) {
    catchIn(
        fmt::format("without condition {:#x}", flag),
        [&](std::uint64_t seed) { return virtuoseBrokenBy(seed, flag); }, kVirtuoseSeeds);
  }
}

}  // namespace
}  // namespace needlelab::test
