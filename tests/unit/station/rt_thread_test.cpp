#include "station/rt_thread.h"

#include <gtest/gtest.h>

#include <thread>

namespace needlelab {
namespace {

TEST(RtThread, eachStepTellsWhetherItWorkedAndWhatThatMeans) {
  // whatever this machine allows: no step is silent
  std::vector<RtStep> steps;
  std::thread([&] { steps = makeThreadRealTime(10); }).join();
  ASSERT_EQ(steps.size(), 3u);
  for (const RtStep& step : steps) {
    EXPECT_FALSE(step.name.empty());
    EXPECT_FALSE(step.message.empty());
  }
}

TEST(RtThread, aPriorityThatDoesNotExistIsNotTakenSilently) {
  std::vector<RtStep> steps;
  std::thread([&] { steps = makeThreadRealTime(1000); }).join();
  EXPECT_FALSE(steps[0].ok);
  EXPECT_NE(steps[0].message.find("ordinary priority"), std::string::npos);
}

TEST(SteadyLoopClock, sleepsUntilTheTimeAndNotForTimesThatPassed) {
  SteadyLoopClock clock;
  const std::int64_t due = clock.nowNs() + 3'000'000;
  clock.sleepUntilNs(due);
  EXPECT_GE(clock.nowNs(), due);
  const std::int64_t before = clock.nowNs();
  clock.sleepUntilNs(before - 1'000'000'000);
  EXPECT_LT(clock.nowNs() - before, 1'000'000'000);
}

}  // namespace
}  // namespace needlelab
