#include <gmock/gmock.h>
#include <pthread.h>
#include <sched.h>

#include <cstdlib>
#include <fstream>
#include <thread>

#include "client/station/run/loop/real_time.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

TEST(RealTimeThread, eachStepTellsWhetherItWorkedAndWhatThatMeans) {
  // Every step gives a message, regardless of what this machine allows.
  std::vector<RtStep> steps;
  std::thread([&] { steps = makeThreadRealTime(10); }).join();
  ASSERT_EQ(steps.size(), 3u);
  for (const RtStep& step : steps) {
    EXPECT_FALSE(step.name.empty());
    EXPECT_FALSE(step.message.empty());
  }
}

TEST(RealTimeThread, runsAtItsReportedPriority) {
  std::vector<RtStep> steps;
  int policy = -1;
  sched_param now{};
  std::thread([&] {
    steps = makeThreadRealTime(10);
    ::pthread_getschedparam(::pthread_self(), &policy, &now);
  }).join();
  EXPECT_EQ(policy, steps[0].ok ? SCHED_FIFO : SCHED_OTHER);
  EXPECT_EQ(now.sched_priority, steps[0].ok ? 10 : 0);
  // deploy/test removes this privilege for all tests, then runs this one again with it
  if (std::getenv("NEEDLELAB_MAY_FIFO") != nullptr) EXPECT_TRUE(steps[0].ok) << steps[0].message;
}

TEST(RealTimeThread, aPriorityThatDoesNotExistIsNotTakenSilently) {
  std::vector<RtStep> steps;
  std::thread([&] { steps = makeThreadRealTime(1000); }).join();
  EXPECT_FALSE(steps[0].ok);
  EXPECT_NE(steps[0].message.find("ordinary priority"), std::string::npos);
}

TEST(RealTimeThread, aDedicatedCoreIsUsedAndAMissingOneIsNamed) {
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

cpu_set_t coresOfThisThread() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  ::pthread_getaffinity_np(::pthread_self(), sizeof cores, &cores);
  return cores;
}

TEST(LoopCore, isTheOneAskedForOrTheLastOfSeveral) {
  EXPECT_EQ(coreForLoop(5), 5);
  const cpu_set_t cores = coresOfThisThread();
  const auto chosen = coreForLoop(std::nullopt);
  ASSERT_EQ(chosen.has_value(), CPU_COUNT(&cores) > 1);
  if (!chosen) return;
  EXPECT_TRUE(CPU_ISSET(*chosen, &cores));
  for (int core = *chosen + 1; core < CPU_SETSIZE; ++core) EXPECT_FALSE(CPU_ISSET(core, &cores));
}

TEST(LoopCore, newThreadsAvoidTheLoopsCoreAndTheLoopKeepsIt) {
  const auto core = coreForLoop(std::nullopt);
  if (!core) GTEST_SKIP() << "this process may use one core only";
  const cpu_set_t before = coresOfThisThread();
  cpu_set_t meanwhile, later;
  {
    const KeepOffCore keep_off(core);
    std::thread([&] { meanwhile = coresOfThisThread(); }).join();
  }
  std::thread([&] { later = coresOfThisThread(); }).join();
  EXPECT_EQ(CPU_COUNT(&meanwhile), CPU_COUNT(&before) - 1);
  EXPECT_FALSE(CPU_ISSET(*core, &meanwhile));
  EXPECT_TRUE(CPU_EQUAL(&later, &before));
}

TEST(LoopCore, theOnlyCoreIsLeftToAll) {
  const cpu_set_t before = coresOfThisThread();
  int first = 0;
  while (!CPU_ISSET(first, &before)) ++first;
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(first, &one);
  std::thread([&] {
    ASSERT_EQ(::pthread_setaffinity_np(::pthread_self(), sizeof one, &one), 0);
    EXPECT_EQ(coreForLoop(std::nullopt), std::nullopt);
    const KeepOffCore keep_off(first);
    const cpu_set_t now = coresOfThisThread();
    EXPECT_TRUE(CPU_EQUAL(&now, &one));
  }).join();
}

TEST(RealTimeThread, aCoreThatNeedsThePriorityIsNotTakenWithoutIt) {
  RtOptions options;
  options.priority = 1000;  // refused everywhere
  options.cpu = 0;
  options.cpu_needs_fifo = true;
  std::vector<RtStep> steps;
  std::thread([&] { steps = makeThreadRealTime(options); }).join();
  for (const RtStep& step : steps) EXPECT_NE(step.name, "core");
}

TEST(RealTimeThread, theSpinsCostIsReported) {
  RtOptions options;
  options.spin_ns = 80'000;
  std::vector<RtStep> steps;
  std::thread([&] { steps = makeThreadRealTime(options); }).join();
  EXPECT_EQ(steps.back().name, "spin");
  EXPECT_THAT(steps.back().message, testing::HasSubstr("last 80 µs before each tick"));
  EXPECT_THAT(steps.back().message, testing::HasSubstr("8 % of a core"));
}

TEST(RealTime, aSpinNeverEndsBeforeTheTime) {
  LoopTime clock(200'000);
  for (int i = 0; i < 20; ++i) {
    const std::int64_t due = clock.nowNs() + 500'000;
    clock.sleepUntilNs(due);
    ASSERT_GE(clock.nowNs(), due);
  }
  const std::int64_t before = clock.nowNs();
  clock.sleepUntilNs(before - 1'000'000);
  EXPECT_LT(clock.nowNs() - before, 1'000'000'000);
}

TEST(RealTime, sleepsUntilTheTimeAndNotForTimesThatPassed) {
  LoopTime clock;
  const std::int64_t due = clock.nowNs() + 3'000'000;
  clock.sleepUntilNs(due);
  EXPECT_GE(clock.nowNs(), due);
  const std::int64_t before = clock.nowNs();
  clock.sleepUntilNs(before - 1'000'000'000);
  EXPECT_LT(clock.nowNs() - before, 1'000'000'000);
}

using testing::HasSubstr;

/// A fake machine made of files.
class RealTimeMachine : public testing::Test {
 protected:
  void put(const std::string& path, const std::string& text) {
    std::filesystem::create_directories((folder_.path() / path).parent_path());
    std::ofstream(folder_.path() / path) << text << "\n";
  }
  void fifoShare(const std::string& runtime_us) {
    put("proc/sys/kernel/sched_rt_runtime_us", runtime_us);
    put("proc/sys/kernel/sched_rt_period_us", "1000000");
  }
  TempFolder folder_;
};

TEST_F(RealTimeMachine, whatCannotBeSeenIsNotSpokenOf) {
  EXPECT_TRUE(judgeMachine({}, folder_.path()).empty());
}

TEST_F(RealTimeMachine, theFifoThrottleMattersOnlyToALongSpin) {
  fifoShare("950000");
  RtOptions options;
  options.spin_ns = 200'000;
  auto steps = judgeMachine(options, folder_.path());
  ASSERT_EQ(steps.size(), 1u);
  EXPECT_TRUE(steps[0].ok);
  EXPECT_THAT(steps[0].message, HasSubstr("95 %"));
  options.rate_hz = 4500;
  steps = judgeMachine(options, folder_.path());
  EXPECT_FALSE(steps[0].ok);
  EXPECT_THAT(steps[0].message, HasSubstr("the spin alone takes 90 %"));
  fifoShare("-1");
  EXPECT_TRUE(judgeMachine(options, folder_.path())[0].ok);
}

TEST_F(RealTimeMachine, aGovernorThatSavesPowerIsNamedWithItsCure) {
  put("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
  EXPECT_TRUE(judgeMachine({}, folder_.path())[0].ok);
  put("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave");
  const auto both = judgeMachine({}, folder_.path());
  ASSERT_EQ(both.size(), 1u);
  EXPECT_FALSE(both[0].ok);
  EXPECT_THAT(both[0].message, HasSubstr("performance, powersave"));
  EXPECT_THAT(both[0].message, HasSubstr("cpupower"));
  // On an isolated core, only that core counts.
  RtOptions options;
  options.cpu = 0;
  EXPECT_TRUE(judgeMachine(options, folder_.path())[0].ok);
}

TEST_F(RealTimeMachine, deepSleepIsHeldOffByAFileThatStaysOpen) {
  put("dma_latency", "");
  {
    const ShallowSleep awake(folder_.path() / "dma_latency");
    EXPECT_TRUE(awake.step().ok) << awake.step().message;
  }
  std::ifstream in(folder_.path() / "dma_latency", std::ios::binary);
  std::int32_t value = -1;
  in.read(reinterpret_cast<char*>(&value), sizeof value);
  EXPECT_EQ(value, 0);
  const ShallowSleep not_there(folder_.path() / "none");
  EXPECT_FALSE(not_there.step().ok);
  EXPECT_THAT(not_there.step().message, HasSubstr("wake late"));
}

}  // namespace
}  // namespace needlelab::test
