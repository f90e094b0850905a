#include <gmock/gmock.h>

#include <cmath>
#include <csignal>
#include <functional>
#include <optional>
#include <vector>

#include "client/station/run/loop/zero_force_loop.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/blocked_signals.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/time/device_world.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab {
namespace {

using test::BlockedSignals;
using test::DeviceWorld;
using test::FakeDevice;
using test::FakeTime;
using test::kMs;

FakeDevice::Script resting() {
  return [](std::uint64_t, DeviceReading& reading) {
    reading.X_WH.p = {0.4, 0, 0};
    return DeviceRead::kFresh;
  };
}

TEST(ZeroForceLoop, answersEveryReadingWithZeroAndKeepsEveryTenth) {
  FakeDevice device(resting());
  FakeTime clock;
  ZeroForceLoop loop(device, clock, {1000, 100, 10});
  loop.run();
  EXPECT_EQ(loop.stats().ran, 100u);
  EXPECT_EQ(loop.stats().fresh, 100u);
  EXPECT_EQ(loop.stats().wakeup.total(), 100u);
  EXPECT_EQ(device.writes.size(), 101u);
  for (const Wrench& wrench : device.writes) EXPECT_EQ(wrench, Wrench{});
  ASSERT_EQ(loop.samples().size(), 10u);
  EXPECT_DOUBLE_EQ(loop.samples()[3].t_s, 0.030);
}

TEST(ZeroForceLoop, aLateWakeUpMissesTicksAndTheDeviceSkipsThem) {
  FakeDevice device(resting());
  FakeTime clock;
  clock.late_ns[50] = 4'300'000;
  ZeroForceLoop loop(device, clock, {1000, 100, 1});
  loop.run();
  EXPECT_EQ(loop.stats().missed, 4u);
  EXPECT_EQ(loop.stats().ran, 96u);
  EXPECT_EQ(loop.stats().ticks, 100u);
  EXPECT_EQ(device.skipped, 4u);
  EXPECT_EQ(loop.stats().wakeup.max_ns(), 4'300'000);
}

// a self-test's rate is ticks over seconds: N ticks take N periods, one tick takes one
TEST(ZeroForceLoop, itsSecondsCountTheLastPeriod) {
  for (const std::uint64_t ticks : {1u, 25u, 1000u}) {
    FakeDevice device(resting());
    FakeTime clock;
    ZeroForceLoop loop(device, clock, {1000, ticks, 1});
    loop.run();
    EXPECT_NEAR(static_cast<double>(loop.stats().ran) / loop.stats().seconds, 1000, 0.1) << ticks;
  }
}

TEST(ZeroForceLoop, countsSilenceConditionsAndBadPoses) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.condition = 0;
    if (tick < 10) reading.condition = kDeviceReleased;
    if (tick >= 20 && tick < 27) return DeviceRead::kNoUpdate;
    reading.X_WH.p = {tick == 40 ? std::nan("") : 0.4, 0, 0};
    reading.X_WH.q = tick == 41 ? Quat{0, 0, 0, 0} : Quat{};
    return DeviceRead::kFresh;
  });
  FakeTime clock;
  ZeroForceLoop loop(device, clock, {1000, 50, 1});
  loop.run();
  EXPECT_EQ(loop.stats().longest_silence, 7u);
  EXPECT_EQ(loop.stats().fresh, 43u);
  EXPECT_EQ(loop.stats().bad_poses, 2u);
  EXPECT_EQ(loop.stats().condition_ticks[23], 10u);
  EXPECT_EQ(loop.stats().last_condition, 0u);
  EXPECT_EQ(loop.samples().size(), 41u);
}

TEST(ZeroForceLoop, endsWithTheRecording) {
  FakeDevice device([](std::uint64_t tick, DeviceReading&) {
    return tick < 5 ? DeviceRead::kFresh : DeviceRead::kFinished;
  });
  FakeTime clock;
  ZeroForceLoop loop(device, clock, {1000, 50, 1});
  loop.run();
  EXPECT_TRUE(loop.stats().device_finished);
  EXPECT_EQ(loop.stats().ran, 5u);
}

TEST(ZeroForceLoop, allocatesNothingInItsTicks) {
  FakeDevice device(resting());
  FakeTime clock;
  ZeroForceLoop loop(device, clock, {1000, 2000, 1});
  const test::NoAllocScope guard;
  loop.run();
  EXPECT_EQ(guard.calls(), 0u);
}

// Loop and owner in a simulated world: the first tick is due after 2 ms, the owner polls every 50 ms. If both
// fall on the same time, the tick comes first.
class ZeroForceRunTest : public testing::Test {
 protected:
  struct Look {
    std::int64_t at_ms;
    std::uint64_t ticks;
    bool operator==(const Look&) const = default;
  };
  class MaintainedDevice final : public Device {
   public:
    explicit MaintainedDevice(FakeDevice& device) : device_(device) {}
    [[nodiscard]] const DeviceInfo& info() const override { return device_.info(); }
    Status open(double rate_hz) override { return device_.open(rate_hz); }
    DeviceRead read(DeviceReading& reading) noexcept override { return device_.read(reading); }
    void write(const GuardedWrench& wrench) noexcept override { device_.write(wrench); }
    std::uint64_t skip(std::uint64_t ticks) noexcept override { return device_.skip(ticks); }
    void maintain() override { ++maintained; }
    void close() noexcept override { device_.close(); }
    int maintained = 0;

   private:
    FakeDevice& device_;
  };

  // `goes_on`: what progress returns at its n-th call, from 1
  ZeroForceRun runLoop(std::uint64_t max_ticks, const std::function<bool(std::size_t call)>& goes_on) {
    loop_.emplace(device_, world_, ZeroForceSettings{1000, max_ticks, 1000});
    const auto progress = [&] {
      looks_.push_back({sinceBeginning_ms(), fake_.reads});
      EXPECT_DOUBLE_EQ(loop_->elapsed_s(), 1e-3 * static_cast<double>(fake_.reads));
      return goes_on(looks_.size());
    };
    return runZeroForceLoop(*loop_, device_, nullptr, blocked_.set(), progress, world_, world_);
  }
  [[nodiscard]] std::int64_t sinceBeginning_ms() { return (world_.nowNs() - begun_ns_) / kMs; }

  const BlockedSignals blocked_{SIGTERM};
  DeviceWorld world_;
  const std::int64_t begun_ns_ = world_.nowNs();
  FakeDevice fake_{resting()};
  MaintainedDevice device_{fake_};
  std::optional<ZeroForceLoop> loop_;
  std::vector<Look> looks_;
};

TEST_F(ZeroForceRunTest, looksTwentyTimesASecondUntilTheLoopHasEnded) {
  // 1,001 ticks: the last one at 1,002 ms
  const ZeroForceRun run = runLoop(1001, [](std::size_t) { return true; });
  EXPECT_FALSE(run.stopped);
  EXPECT_TRUE(run.realtime.empty()) << "an ordinary thread was asked for";
  std::vector<Look> expected;
  for (std::int64_t ms = 50; ms <= 1000; ms += 50)
    expected.push_back({ms, static_cast<std::uint64_t>(ms) - 1});
  expected.push_back({1050, 1001});
  EXPECT_EQ(looks_, expected);
  EXPECT_EQ(device_.maintained, 21);
  EXPECT_EQ(loop_->stats().ran, 1001u);
  EXPECT_EQ(loop_->stats().missed, 0u);
}

TEST_F(ZeroForceRunTest, progressEndsTheLoopOnceAtTheNextTick) {
  const ZeroForceRun run = runLoop(100'000, [](std::size_t call) { return call < 3; });
  EXPECT_FALSE(run.stopped);
  EXPECT_EQ(looks_, (std::vector<Look>{{50, 49}, {100, 99}, {150, 149}}));
  EXPECT_EQ(loop_->stats().ran, 150u);
  EXPECT_EQ(device_.maintained, 4) << "once more, until it saw the end";
  EXPECT_EQ(sinceBeginning_ms(), 200);
  EXPECT_EQ(fake_.writes.back(), Wrench{});
}

TEST_F(ZeroForceRunTest, aSignalEndsTheLoopAtTheNextLook) {
  world_.at(begun_ns_ + 120 * kMs, [] { ::raise(SIGTERM); });
  const ZeroForceRun run = runLoop(100'000, [](std::size_t) { return true; });
  EXPECT_TRUE(run.stopped);
  EXPECT_EQ(looks_, (std::vector<Look>{{50, 49}, {100, 99}, {150, 149}, {200, 150}}));
  EXPECT_EQ(loop_->stats().ran, 150u);
}

TEST_F(ZeroForceRunTest, aSignalFromBeforeCountsAtOnce) {
  ::raise(SIGTERM);
  const ZeroForceRun run = runLoop(100'000, [](std::size_t) { return true; });
  EXPECT_TRUE(run.stopped);
  // the loop learns it before its first tick
  EXPECT_EQ(looks_, (std::vector<Look>{{0, 0}, {50, 0}}));
  EXPECT_EQ(loop_->stats().ran, 0u);
}

}  // namespace
}  // namespace needlelab
