#include "station/rt_thread.h"

#include <gmock/gmock.h>
#include <pthread.h>
#include <sched.h>

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

TEST(RtThread, aCoreOfItsOwnIsKeptAndOneThatIsNotThereIsNamed) {
  cpu_set_t allowed;
  ASSERT_EQ(::pthread_getaffinity_np(::pthread_self(), sizeof allowed, &allowed), 0);
  RtOptions options;
  for (int core = 0; core < CPU_SETSIZE && !options.cpu; ++core)
    if (CPU_ISSET(core, &allowed)) options.cpu = core;
  std::vector<RtStep> steps;
  std::thread([&] {
    steps = makeThreadRealTime(options);
    EXPECT_EQ(::sched_getcpu(), *options.cpu);
    cpu_set_t now;
    ::pthread_getaffinity_np(::pthread_self(), sizeof now, &now);
    EXPECT_EQ(CPU_COUNT(&now), 1);
  }).join();
  EXPECT_EQ(steps.back().name, "core");
  EXPECT_TRUE(steps.back().ok) << steps.back().message;

  options.cpu = CPU_SETSIZE - 1;
  std::thread([&] { steps = makeThreadRealTime(options); }).join();
  EXPECT_FALSE(steps.back().ok);
  EXPECT_THAT(steps.back().message, testing::HasSubstr("which may use "));
}

TEST(RtThread, theSpinSaysWhatItCosts) {
  RtOptions options;
  options.spin_ns = 80'000;
  std::vector<RtStep> steps;
  std::thread([&] { steps = makeThreadRealTime(options); }).join();
  EXPECT_EQ(steps.back().name, "spin");
  EXPECT_THAT(steps.back().message, testing::HasSubstr("last 80 µs before each tick"));
  EXPECT_THAT(steps.back().message, testing::HasSubstr("8 % of a core"));
}

TEST(SteadyLoopClock, aSpinNeverEndsBeforeTheTime) {
  SteadyLoopClock clock(200'000);
  for (int i = 0; i < 20; ++i) {
    const std::int64_t due = clock.nowNs() + 500'000;
    clock.sleepUntilNs(due);
    ASSERT_GE(clock.nowNs(), due);
  }
  const std::int64_t before = clock.nowNs();
  clock.sleepUntilNs(before - 1'000'000);
  EXPECT_LT(clock.nowNs() - before, 1'000'000'000);
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
