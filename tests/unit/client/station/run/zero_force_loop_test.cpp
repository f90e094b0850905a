#include <gmock/gmock.h>

#include <cmath>

#include "client/station/run/zero_force_loop.h"
#include "common/haptics/device_condition.h"
#include "tests/support/no_alloc.h"
#include "tests/unit/client/station/run/fake_loop.h"

namespace needlelab {
namespace {

using test::FakeDevice;
using test::FakeTime;

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

// the rate of a self-test is ticks over seconds: N ticks take N periods, one tick one
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

TEST(ZeroForceLoop, progressEndsIt) {
  FakeDevice device(resting());
  FakeTime clock;
  constexpr std::uint64_t kNeverReached = 1'000'000'000'000;
  ZeroForceLoop loop(device, clock, {1000, kNeverReached, kNeverReached / 10});
  sigset_t none;
  sigemptyset(&none);
  int calls = 0;
  const ZeroForceRun run = runZeroForceLoop(loop, device, nullptr, none, [&] { return ++calls < 3; });
  EXPECT_FALSE(run.stopped);
  EXPECT_EQ(calls, 3);
  EXPECT_LT(loop.stats().ran, kNeverReached);
}

}  // namespace
}  // namespace needlelab
