// Thousands of simulated lessons with a Falcon. A seed decides what goes wrong, when, and who wakes first.
// The rules of FalconRun hold in each. A failing seed is printed with the command that replays it; keep it in
// the file `falcon_regressions`, with its reason.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"
#include "tests/unit/client/device/world/falcon_run.h"
#include "tests/unit/client/device/world/seeds.h"

namespace needlelab::test {
namespace {

/// Of the short form; each planted bug must show within this many.
constexpr std::uint64_t kFalconSeeds = 2'000;

std::string falconBrokenBy(std::uint64_t seed, double gate_rate_hz = 1000) {
  FalconRun run(falconPlanOf(seed), gate_rate_hz);
  run.play();
  return run.broken();
}

SeededRuns falconRuns() {
  return {"FalconSeeds", [](std::uint64_t seed) { return falconBrokenBy(seed); },
          [](std::uint64_t seed) { return textOf(falconPlanOf(seed)); }};
}

TEST(FalconSeeds, everyRunKeepsTheRules) {
  playSeeds(falconRuns(), longForm() ? 200'000 : kSanitized ? 100 : kFalconSeeds);
}

TEST(FalconSeeds, seedsThatOnceFailedKeepTheRules) {
  playRegressions(falconRuns(), NEEDLELAB_WORLD "/falcon_regressions");
}

TEST(FalconSeeds, theSameSeedIsTheSameRunToTheBit) {
  std::set<std::uint64_t> traces;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    FalconRun one(falconPlanOf(seed)), other(falconPlanOf(seed));
    one.play();
    other.play();
    EXPECT_EQ(one.trace(), other.trace()) << again(falconRuns(), seed);
    EXPECT_GT(one.ticks(), 100u);
    traces.insert(one.trace());
  }
  EXPECT_EQ(traces.size(), 20u);
}

// ---- proof that the rules can be broken

TEST(FalconSeeds, eachPlantedBugIsCaught) {
  for (const PlantedBug bug :
       {PlantedBug::kDeviceWatchdogTwice, PlantedBug::kTorqueWithoutZero, PlantedBug::kRequestOutlivesLink,
        PlantedBug::kNoLastCommand, PlantedBug::kRescanTooLate})
    catchBug(falconRuns(), bug, kFalconSeeds);
}

TEST(FalconSeeds, aGateThatCountsTicksWronglyIsCaught) {
  // at 500 Hz it fades in within 100 ticks, at 2 kHz it fades out within 40
  for (const double rate_hz : {500.0, 2000.0}) {
    catchIn(
        fmt::format("gate at {} Hz", rate_hz),
        [&](std::uint64_t seed) { return falconBrokenBy(seed, rate_hz); }, kFalconSeeds);
  }
}

}  // namespace
}  // namespace needlelab::test
