#include "client/station/run/rt_machine.h"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

/// A machine made of files.
class RtMachine : public testing::Test {
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

TEST_F(RtMachine, whatCannotBeSeenIsNotSpokenOf) {
  EXPECT_TRUE(judgeMachine({}, folder_.path()).empty());
}

TEST_F(RtMachine, theSystemsLimitForFifoThreadsMattersOnlyToALoopThatSpinsALot) {
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

TEST_F(RtMachine, aGovernorThatSavesPowerIsNamedWithItsCure) {
  put("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
  EXPECT_TRUE(judgeMachine({}, folder_.path())[0].ok);
  put("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave");
  const auto both = judgeMachine({}, folder_.path());
  ASSERT_EQ(both.size(), 1u);
  EXPECT_FALSE(both[0].ok);
  EXPECT_THAT(both[0].message, HasSubstr("performance, powersave"));
  EXPECT_THAT(both[0].message, HasSubstr("cpupower"));
  // on a core of its own only that core counts
  RtOptions options;
  options.cpu = 0;
  EXPECT_TRUE(judgeMachine(options, folder_.path())[0].ok);
}

TEST_F(RtMachine, deepSleepIsHeldOffByAFileThatStaysOpen) {
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
