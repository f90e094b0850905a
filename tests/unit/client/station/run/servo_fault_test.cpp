// FAULT in the loop: waited out or not, acknowledged, and the end from outside.
#include <gmock/gmock.h>

#include <limits>

#include "common/haptics/device_condition.h"
#include "tests/unit/client/station/run/loop_fixture.h"

namespace needlelab::test {
namespace {

// down to a force, no reading from `silent_from` to `back_at`, then outside the tissue
FakeDevice::Script silentFor(std::uint64_t silent_from, std::uint64_t back_at) {
  return [=](std::uint64_t tick, DeviceReading& reading) {
    if (tick < silent_from) return goingDown(0.02, kRate)(tick, reading);
    if (tick < back_at) return DeviceRead::kNoUpdate;
    reading.X_WH = {{0, 0, 5e-3}, {1, 0, 0, 0}};
    return DeviceRead::kFresh;
  };
}

ServoSettings waiting(std::uint64_t ticks) {
  return {kRate, {}, ticks, FaultPolicy::kWait};
}

class ServoFault : public LoopFixture {
 protected:
  [[nodiscard]] std::uint64_t ticksInFault() const {
    std::uint64_t ticks = 0;
    for (const GestureSample& s : samples_) ticks += s.fault != 0;
    return ticks;
  }
};

TEST_F(ServoFault, waitingLoopGoesOnWithoutForceReadingAndRecording) {
  FakeDevice device(silentFor(300, 400));
  const ServoStats& stats = run(device, waiting(1000));
  EXPECT_EQ(stats.end, ServoEnd::kTicksDone);
  EXPECT_EQ(stats.samples, 1000u);
  EXPECT_EQ(device.reads, 1000u);
  EXPECT_EQ(stats.faults, 1u);
  EXPECT_EQ(stats.first_fault, Fault::kDeviceSilent);
  EXPECT_EQ(stats.fault, Fault::kDeviceSilent) << "nobody acknowledged it: it stands to the end";
  EXPECT_EQ(loop_->fault(), Fault::kDeviceSilent);
  EXPECT_EQ(loop_->faults(), 1u);
  // the watchdog's 20 ms are over in the 21st silent tick
  EXPECT_EQ(samples_[319].fault, 0);
  EXPECT_EQ(samples_[320].fault, static_cast<std::uint8_t>(Fault::kDeviceSilent));
  EXPECT_EQ(stats.fault_ticks, ticksInFault());
  EXPECT_EQ(stats.fault_ticks, 1000u - 320u);
  ASSERT_GT(samples_[319].force_W_N[2], 0.5) << "there was a force to take away";
  for (std::size_t k = 340; k < 1000; ++k) ASSERT_EQ(device.writes[k], Wrench{}) << k;
}

TEST_F(ServoFault, anAcknowledgementRestartsOnceTheDeviceIsBackAndTheTipOutside) {
  FakeDevice device(silentFor(300, 400));
  device.on_write = [&](std::uint64_t tick) {
    if (tick == 350) loop_->acknowledge();  // while the device is still silent: does not count
    if (tick == 450) loop_->acknowledge();
  };
  const ServoStats& stats = run(device, waiting(1000));
  EXPECT_EQ(stats.fault, Fault::kNone);
  EXPECT_EQ(stats.faults, 1u);
  EXPECT_EQ(stats.first_fault, Fault::kDeviceSilent);
  EXPECT_EQ(stats.fault_ticks, ticksInFault());
  EXPECT_NE(samples_[449].fault, 0);
  EXPECT_EQ(samples_[455].fault, 0);
  EXPECT_EQ(loop_->fault(), Fault::kNone);
}

TEST_F(ServoFault, anAcknowledgementBeforeTheFaultDoesNotCount) {
  FakeDevice device(silentFor(300, 400));
  device.on_write = [&](std::uint64_t tick) {
    if (tick == 100 || tick == 310) loop_->acknowledge();
  };
  EXPECT_EQ(run(device, waiting(1000)).fault, Fault::kDeviceSilent);
}

TEST_F(ServoFault, eachFaultNeedsItsOwnAcknowledgementAndIsCounted) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH = {{0, 0, 5e-3}, {1, 0, 0, 0}};
    const std::uint64_t in_second = tick % 1000;
    return in_second >= 500 && in_second < 600 ? DeviceRead::kNoUpdate : DeviceRead::kFresh;
  });
  device.on_write = [&](std::uint64_t tick) {
    if (tick == 700 || tick == 1700) loop_->acknowledge();
  };
  const ServoStats& stats = run(device, waiting(3000));
  EXPECT_EQ(stats.faults, 3u);
  EXPECT_EQ(stats.fault, Fault::kDeviceSilent) << "the third was not acknowledged";
  EXPECT_EQ(stats.fault_ticks, ticksInFault());
}

TEST_F(ServoFault, missedTicksDuringAFaultAreCountedAsEver) {
  FakeDevice device(silentFor(300, 400));
  clock_.late_ns[350] = 12 * kTick_ns;
  device.on_write = [&](std::uint64_t tick) {
    if (tick == 450) loop_->acknowledge();
  };
  const ServoStats& stats = run(device, waiting(1000));
  EXPECT_EQ(stats.missed_ticks, 12u);
  EXPECT_EQ(stats.samples, 988u);
  EXPECT_EQ(stats.fault, Fault::kNone);
}

TEST_F(ServoFault, whatTheDeviceSaysOfItselfIsReadableFromOutside) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    goingDown(0.001, kRate)(tick, reading);
    reading.condition = tick >= 50 && tick < 80 ? std::uint32_t{kDeviceSaturated} : 0;
    return DeviceRead::kFresh;
  });
  std::vector<std::uint32_t> seen;
  device.on_write = [&](std::uint64_t) { seen.push_back(loop_->condition()); };
  const ServoStats& stats = run(device, waiting(200));
  EXPECT_EQ(seen[60], std::uint32_t{kDeviceSaturated});
  EXPECT_EQ(seen[100], 0u);
  EXPECT_EQ(stats.flag_ticks[26], 30u);
}

TEST_F(ServoFault, crashStopTakesTheForceAwayWithin20MsAndEndsTheLoop) {
  for (const FaultPolicy policy : {FaultPolicy::kEnd, FaultPolicy::kWait}) {
    samples_.clear();
    FakeDevice device(goingDown(0.02, kRate));
    device.on_write = [&](std::uint64_t tick) {
      if (tick == 350) loop_->crashStop();
    };
    const ServoStats& stats = run(device, {kRate, {}, 0, policy});
    EXPECT_EQ(stats.end, ServoEnd::kCrash);
    EXPECT_EQ(stats.first_fault, Fault::kProgramTrouble);
    EXPECT_EQ(stats.samples, 370u);
    EXPECT_TRUE(loop_->ended());
    ASSERT_GT(samples_[349].force_W_N[2], 0.9);
    // the gate's ramp: a straight line
    EXPECT_NEAR(samples_[359].force_W_N[2], samples_[349].force_W_N[2] / 2, 1e-9);
    EXPECT_EQ(samples_[369].force_W_N[2], 0);
    EXPECT_EQ(device.writes.back(), Wrench{});
    // the recording says why
    EXPECT_EQ(samples_[360].fault, static_cast<std::uint8_t>(Fault::kProgramTrouble));
  }
}

TEST_F(ServoFault, crashStopInAFaultEndsTheWaitingAndKeepsTheFirstCause) {
  FakeDevice device(silentFor(300, 100'000));
  device.on_write = [&](std::uint64_t tick) {
    if (tick == 600) loop_->acknowledge();
    if (tick == 600) loop_->crashStop();
  };
  const ServoStats& stats = run(device, waiting(0));
  EXPECT_EQ(stats.end, ServoEnd::kCrash);
  EXPECT_EQ(stats.samples, 620u);
  EXPECT_EQ(stats.fault, Fault::kDeviceSilent);
  EXPECT_EQ(stats.faults, 1u);
}

TEST_F(ServoFault, stopEndsAWaitingLoop) {
  FakeDevice device(silentFor(300, 100'000));
  device.on_write = [&](std::uint64_t tick) {
    if (tick == 600) loop_->stop();
  };
  const ServoStats& stats = run(device, waiting(0));
  EXPECT_EQ(stats.end, ServoEnd::kStopped);
  EXPECT_EQ(stats.fault, Fault::kDeviceSilent);
}

TEST_F(ServoFault, latestGivesEachTickOnce) {
  FakeDevice device(goingDown(0.02, kRate));
  std::vector<std::uint64_t> seen;
  GestureSample sample;
  device.on_write = [&](std::uint64_t tick) {
    if (tick % 10 == 0 && loop_->latest(sample)) seen.push_back(sample.tick);
    EXPECT_FALSE(tick % 10 == 0 && loop_->latest(sample));
    EXPECT_FALSE(loop_->ended());
  };
  run(device, waiting(105));
  ASSERT_EQ(seen.size(), 10u);
  // the device's n-th write happens before the loop publishes tick n − 1
  for (std::size_t i = 0; i < seen.size(); ++i) EXPECT_EQ(seen[i], 10 * (i + 1) - 2);
}

static_assert(
    noexcept(std::declval<ServoLoop&>().run()) && noexcept(std::declval<ServoLoop&>().stop()) && noexcept(
        std::declval<ServoLoop&>().crashStop()) && noexcept(std::declval<ServoLoop&>().acknowledge()));

}  // namespace
}  // namespace needlelab::test
