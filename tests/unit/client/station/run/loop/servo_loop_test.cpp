#include <gmock/gmock.h>

#include <limits>

#include "client/station/run/loop/servo_loop.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/geometry.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/unit/client/station/run/loop/loop_fixture.h"

namespace needlelab::test {
namespace {

class ServoLoopTest : public LoopFixture {};

TEST_F(ServoLoopTest, everyTickGivesOneSampleWithDueTimeAndEngineForce) {
  FakeDevice device(goingDown(0.02, kRate));
  const ServoStats& stats = run(device, {kRate, {}, 400});
  EXPECT_EQ(stats.end, ServoEnd::kTicksDone);
  EXPECT_EQ(stats.ticks, 400u);
  EXPECT_EQ(stats.samples, 400u);
  EXPECT_EQ(stats.missed_ticks, 0u);
  ASSERT_EQ(samples_.size(), 400u);

  // the same motion through engine and gate by hand
  SimState state{};
  StepReport report;
  ForceGate gate(device.device_info.limits, kRate);
  for (std::size_t k = 0; k < 380; ++k) {  // before the force fades out at the end
    const GestureSample& s = samples_[k];
    ASSERT_EQ(s.tick, k);
    ASSERT_EQ(s.time_ns - samples_[0].time_ns, static_cast<std::int64_t>(k) * kTick_ns);
    const Vec3 p{0, 0, 1e-3 - 0.02 * static_cast<double>(k) / kRate};
    ASSERT_EQ((Vec3{s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]}), p);
    ASSERT_TRUE(gate.admit({p, {1, 0, 0, 0}}, true, 0));
    step(model_, {p, {1, 0, 0, 0}}, state, report);
    const Wrench out = gate.guard(report.wrench_W).wrench();
    ASSERT_EQ((Vec3{s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]}), out.force_N) << k;
    ASSERT_EQ(device.writes[k].force_N, out.force_N);
    ASSERT_EQ(s.phase, static_cast<std::uint8_t>(report.phase));
    ASSERT_EQ(s.layer, report.layer);
    ASSERT_EQ(s.insertion_m, report.insertion_m);
    ASSERT_EQ(s.flags, report.flags | gate.flags());
    ASSERT_EQ(std::isnan(s.wall_W_m[2]), report.phase == Phase::kFree);
  }
  // the cutting force of 1 N was reached: at 500 N/m after 2 mm of the 7 mm
  EXPECT_NEAR(samples_[370].force_W_N[2], 1.0, 1e-9);
  // The force is zero at the end.
  EXPECT_EQ(samples_.back().force_W_N[2], 0);
  EXPECT_EQ(device.writes.back(), Wrench{});
  EXPECT_EQ(stats.wakeup.max_ns(), 0);
}

TEST_F(ServoLoopTest, aButtonPressesThePlungerOfADeviceWithButtons) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH = {{0, 0, 0.01}, {1, 0, 0, 0}};
    reading.buttons = tick < 150 ? 1u << 3 : 1u << 2;
    reading.plunger = 0.9;
    return DeviceRead::kFresh;
  });
  device.device_info.plunger = PlungerSource::kButtons;
  ServoSettings settings{kRate, {}, 450};
  settings.plunger.push_button = 2;
  settings.plunger.pull_button = 3;
  clock_.late_ns[100] = 10 * kTick_ns;  // the button is also pressed in missed ticks
  run(device, settings);
  EXPECT_NEAR(samples_.front().plunger, 0.2 - 1 / 3000.0, 1e-12);
  EXPECT_NEAR(samples_.back().plunger, 0.2 - 150 / 3000.0 + 300 / 3000.0, 1e-9);
  for (std::size_t i = 1; i < samples_.size(); ++i)
    if (samples_[i].tick <= 149) {
      EXPECT_LT(samples_[i].plunger, samples_[i - 1].plunger);
    }
}

TEST_F(ServoLoopTest, missedTicksAreCountedAndNotSteppedAndTheDeviceGoesOn) {
  FakeDevice device(goingDown(0.02, kRate));
  clock_.late_ns[10] = 3 * kTick_ns + kTick_ns / 2;  // skips ticks 10, 11, 12; 13 is half a period late
  const ServoStats& stats = run(device, {kRate, {}, 100});
  EXPECT_EQ(stats.missed_ticks, 3u);
  EXPECT_EQ(loop_->missedTicks(), 3u);
  EXPECT_EQ(stats.late_wakeups, 1u);
  EXPECT_EQ(stats.ticks, 100u);
  EXPECT_EQ(stats.samples, 97u);
  EXPECT_EQ(device.skipped, 3u);
  ASSERT_EQ(samples_.size(), 97u);
  EXPECT_EQ(samples_[9].tick, 9u);
  EXPECT_EQ(samples_[10].tick, 13u);
  EXPECT_EQ(samples_[10].time_ns, samples_[0].time_ns + 13 * kTick_ns);
  // tick k has the pose of tick k
  for (const GestureSample& s : samples_)
    ASSERT_EQ(s.p_WT_m[2], 1e-3 - 0.02 * static_cast<double>(s.tick) / kRate);
  // the loop is immediately on time again
  EXPECT_EQ(samples_[11].tick, 14u);
  EXPECT_EQ(stats.wakeup.max_ns(), 3 * kTick_ns + kTick_ns / 2);
}

// the last sample lies beyond the limit, so that "within 0.1 s" is not passed by waiting
TEST_F(ServoLoopTest, aTimeLimitBeginsWithTheNeedlesFirstContact) {
  FakeDevice device(goingDown(0.02, kRate));
  ServoSettings settings{kRate, {}};
  settings.needle_ticks = 100;
  const ServoStats& stats = run(device, settings);
  const auto in = std::ranges::find_if(samples_, [](const GestureSample& s) { return s.layer >= 0; });
  ASSERT_NE(in, samples_.end());
  EXPECT_NEAR(static_cast<double>(in->tick), 1e-3 / 0.02 * kRate, 1) << "1 mm above the skin, 20 mm/s";
  EXPECT_EQ(loop_->firstContact(), in->tick);
  EXPECT_EQ(samples_.back().tick, in->tick + 101);
  EXPECT_EQ(stats.end, ServoEnd::kTicksDone);
  EXPECT_EQ(samples_.back().force_W_N[2], 0) << "faded out";
}

TEST_F(ServoLoopTest, lateButNotMissed) {
  FakeDevice device(goingDown(0.02, kRate));
  for (std::uint64_t k = 5; k < 50; k += 5) clock_.late_ns[k] = kTick_ns - 1;
  const ServoStats& stats = run(device, {kRate, {}, 100});
  EXPECT_EQ(stats.missed_ticks, 0u);
  EXPECT_EQ(stats.samples, 100u);
  EXPECT_GE(stats.wakeup.quantile_ns(0.95), kTick_ns - 1);
  EXPECT_EQ(stats.wakeup.quantile_ns(0.5), 0);
}

TEST_F(ServoLoopTest, exactlyOnePeriodLateIsOneMissedTick) {
  FakeDevice device(goingDown(0.02, kRate));
  clock_.late_ns[7] = kTick_ns;
  EXPECT_EQ(run(device, {kRate, {}, 50}).missed_ticks, 1u);
}

TEST_F(ServoLoopTest, aStallOverTheEndCountsOnlyTicksOfTheLesson) {
  FakeDevice device(goingDown(0.001, kRate));
  clock_.late_ns[40] = 500 * kTick_ns;
  const ServoStats& stats = run(device, {kRate, {}, 100});
  EXPECT_EQ(stats.end, ServoEnd::kTicksDone);
  EXPECT_EQ(stats.ticks, 100u);
  EXPECT_EQ(stats.samples + stats.missed_ticks, 100u);
  EXPECT_EQ(device.writes.back(), Wrench{});
}

TEST_F(ServoLoopTest, aStallPastARecordingsEndCountsItsTicksOnly) {
  FakeDevice device(goingDown(0.001, kRate));
  device.ends_at = 60;
  clock_.late_ns[40] = 500 * kTick_ns;
  const ServoStats& stats = run(device, {kRate, {}, 0});
  EXPECT_EQ(stats.end, ServoEnd::kDeviceFinished);
  EXPECT_EQ(stats.samples, 40u);
  EXPECT_EQ(stats.missed_ticks, 20u);
  EXPECT_EQ(loop_->missedTicks(), 20u);
  EXPECT_EQ(stats.ticks, 60u);
  EXPECT_EQ(stats.late_wakeups, 1u);
}

TEST_F(ServoLoopTest, aStallPastBothEndsCountsUpToTheEarlier) {
  for (const std::uint64_t recorded : {60u, 80u, 100u}) {
    FakeDevice device(goingDown(0.001, kRate));
    device.ends_at = recorded;
    clock_.late_ns[clock_.sleeps() + 40] = 500 * kTick_ns;
    const ServoStats& stats = run(device, {kRate, {}, 80});
    EXPECT_EQ(stats.end, recorded < 80 ? ServoEnd::kDeviceFinished : ServoEnd::kTicksDone);
    EXPECT_EQ(stats.missed_ticks, std::min<std::uint64_t>(recorded, 80) - 40);
    EXPECT_EQ(stats.ticks, std::min<std::uint64_t>(recorded, 80));
  }
}

TEST_F(ServoLoopTest, theToolGivesTheTipAndMovesTheWrench) {
  const Pose X_HT{{0.01, -0.02, 0.15}, normalized(Quat{0.02, 0.01, 0, 1})};
  // the tip pierces the surface although the handle stays 0.14 m above it
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH = {{0, 0, 0.15 - 2e-5 * static_cast<double>(tick)}, {1, 0, 0, 0}};
    return DeviceRead::kFresh;
  });
  ASSERT_EQ(run(device, {kRate, X_HT, 500}).samples, 500u) << static_cast<int>(loop_->stats().fault);
  const GestureSample& s = samples_[450];
  const Pose X_WH{{0, 0, 0.15 - 2e-5 * 450}, {1, 0, 0, 0}};
  const Pose X_WT = X_WH * X_HT;
  EXPECT_NEAR(s.p_WT_m[0], X_WT.p.x, 1e-15);
  EXPECT_NEAR(s.p_WT_m[2], X_WT.p.z, 1e-15);
  const Vec3 f{s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]};
  ASSERT_GT(norm(f), 0.5);
  // τ_handle = τ + (p_tip − p_handle) × f, and the recorded torque is about the tip: here none
  EXPECT_EQ(device.writes[450].force_N, f);
  const Vec3 lever = cross(X_WT.p - X_WH.p, f);
  EXPECT_NEAR(norm(device.writes[450].torque_Nm - lever), 0, 1e-12);
  EXPECT_NEAR(std::hypot(s.torque_W_Nm[0], s.torque_W_Nm[1], s.torque_W_Nm[2]), 0, 1e-12);
}

TEST_F(ServoLoopTest, notANumberIsHeldForFiveTicksThenFaults) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    goingDown(0.02, kRate)(tick, reading);
    if (tick >= 300) reading.X_WH.p.x = std::numeric_limits<double>::quiet_NaN();
    return DeviceRead::kFresh;
  });
  const ServoStats& stats = run(device, {kRate, {}, 0});
  EXPECT_EQ(stats.end, ServoEnd::kFault);
  EXPECT_EQ(stats.fault, Fault::kSampleNotFinite);
  // The recording has the held ticks, the gate's ramp and a little more; then zero force.
  EXPECT_LT(stats.ticks, 300u + 5 + 60);
  EXPECT_EQ(device.writes.back(), Wrench{});
  EXPECT_NEAR(samples_[304].force_W_N[2], samples_[299].force_W_N[2], 1e-12);
  EXPECT_EQ(samples_.back().force_W_N[2], 0);
  EXPECT_EQ(samples_.back().fault, static_cast<std::uint8_t>(Fault::kSampleNotFinite));
  EXPECT_TRUE(samples_.back().flags & kFlagNotStepped);
  for (const GestureSample& s : samples_) {
    ASSERT_TRUE(std::isfinite(s.p_WT_m[0])) << "the last good pose replaces an invalid one";
    ASSERT_TRUE(std::isfinite(s.force_W_N[2]));
  }
}

TEST_F(ServoLoopTest, aGoodSampleInTimeResumes) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    goingDown(0.02, kRate)(tick, reading);
    if (tick >= 300 && tick < 304) reading.X_WH.p.x = 1e6;
    return DeviceRead::kFresh;
  });
  const ServoStats& stats = run(device, {kRate, {}, 400});
  EXPECT_EQ(stats.fault, Fault::kNone);
  EXPECT_EQ(stats.end, ServoEnd::kTicksDone);
  EXPECT_EQ(stats.flag_ticks[16], 4u) << "rejected samples are counted";
}

TEST_F(ServoLoopTest, aSilentDeviceFaultsAndAFrozenOneDoesNot) {
  FakeDevice silent([](std::uint64_t tick, DeviceReading& reading) {
    if (tick >= 100) return DeviceRead::kNoUpdate;
    return goingDown(0.02, kRate)(tick, reading);
  });
  EXPECT_EQ(run(silent, {kRate, {}, 1000}).fault, Fault::kDeviceSilent);
  samples_.clear();
  FakeDevice frozen([](std::uint64_t tick, DeviceReading& reading) {
    return goingDown(0.02, kRate)(std::min<std::uint64_t>(tick, 300), reading);
  });
  EXPECT_EQ(run(frozen, {kRate, {}, 2000}).fault, Fault::kNone);
}

TEST_F(ServoLoopTest, theEndOfARecordingEndsTheLoop) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    return tick < 123 ? goingDown(0.02, kRate)(tick, reading) : DeviceRead::kFinished;
  });
  const ServoStats& stats = run(device, {kRate, {}, 0});
  EXPECT_EQ(stats.end, ServoEnd::kDeviceFinished);
  EXPECT_EQ(stats.samples, 123u);
  EXPECT_EQ(stats.ticks, 123u) << "the look that found the end is not a tick";
  EXPECT_EQ(device.writes.back(), Wrench{});
}

TEST_F(ServoLoopTest, stopFadesTheForceOutWithin20Ms) {
  FakeDevice device(goingDown(0.02, kRate));
  device.on_write = [&](std::uint64_t tick) {
    if (tick == 350) loop_->stop();
  };
  const ServoStats& stats = run(device, {kRate, {}, 0});
  EXPECT_EQ(stats.end, ServoEnd::kStopped);
  EXPECT_EQ(stats.samples, 350u + 20u);
  const double before = samples_[349].force_W_N[2];
  ASSERT_GT(before, 0.9);
  for (std::size_t k = 350; k < 370; ++k)
    EXPECT_LE(samples_[k].force_W_N[2], samples_[k - 1].force_W_N[2] + 1e-12) << "falls, never jumps up";
  EXPECT_NEAR(samples_[359].force_W_N[2], before / 2, 0.05);
  EXPECT_EQ(samples_.back().force_W_N[2], 0);
}

TEST_F(ServoLoopTest, aFullRingIsCountedAndTheLoopGoesOn) {
  FakeDevice device(goingDown(0.0005, kRate));
  const ServoStats& stats = run(device, {kRate, {}, kSampleRingCapacity + 500});
  EXPECT_EQ(stats.samples, kSampleRingCapacity + 500);
  EXPECT_EQ(ring_->dropped(), 500u);
  EXPECT_EQ(samples_.size(), kSampleRingCapacity);
}

TEST_F(ServoLoopTest, anyRateKeepsItsTimeOverManyTicks) {
  // the period of 3 kHz is not a whole number of ns: the due times must not drift
  model_ = *compile(paperOneDof(), 3000);
  FakeDevice device(goingDown(0.0005, 3000));
  run(device, {3000, {}, 9001});
  ASSERT_EQ(samples_.size(), 9001u);
  EXPECT_EQ(samples_[9000].time_ns - samples_[0].time_ns, 3'000'000'000);
}

TEST_F(ServoLoopTest, theLoopNeverTouchesTheHeap) {
  model_ = *compile(allEffects(), kRate);
  FakeDevice device(goingDown(0.02, kRate));
  clock_.late_ns[50] = 4 * kTick_ns;
  loop_ = std::make_unique<ServoLoop>(model_, device, clock_, *ring_, ServoSettings{kRate, {}, 2000});
  std::uint64_t calls = 0;
  {
    const NoAllocScope guard;
    loop_->run();
    calls = guard.calls();
  }
  EXPECT_EQ(calls, 0u);
  EXPECT_EQ(loop_->stats().samples, 1996u);
}

TEST_F(ServoLoopTest, aTicksPhasesAreTimedSeparatelyAndAddUp) {
  FakeDevice device(goingDown(0.02, kRate));
  clock_.read_cost_ns = 1000;  // Each clock read costs 1 µs, and each phase ends with one.
  device.read_cost = [&] { clock_.advance(7'000); };
  device.on_write = [&](std::uint64_t) { clock_.advance(2'000); };
  const ServoStats& stats = run(device, {kRate, {}, 50});
  EXPECT_EQ(samples_[10].engine_ns, 1000);
  EXPECT_EQ(samples_[10].device_ns, 8'000 + 3'000);
  // With one value, every quantile is that value: never above the largest.
  EXPECT_EQ(stats.read.quantile_ns(0.5), 8'000);
  EXPECT_EQ(stats.engine.quantile_ns(0.5), 1'000);
  EXPECT_EQ(stats.write.quantile_ns(0.5), 3'000);
  EXPECT_EQ(stats.record.quantile_ns(0.5), 1'000);
  EXPECT_EQ(stats.device.quantile_ns(0.5), 11'000);
  EXPECT_EQ(stats.tick.quantile_ns(0.5), 13'000);
  EXPECT_EQ(stats.wakeup.quantile_ns(0.5), 1'000);
  for (const auto* histogram : {&stats.read, &stats.engine, &stats.write, &stats.record, &stats.tick})
    EXPECT_EQ(histogram->total(), 50u);
}

// FAULT in the loop: with and without waiting for its end, with acknowledgement, and with a stop from
// outside.

// Moves down until there is force, gives no reading from `silent_from` to `back_at`, then is outside the
// tissue.
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
  EXPECT_EQ(stats.fault, Fault::kDeviceSilent) << "no one acknowledged it: it stands to the end";
  EXPECT_EQ(loop_->fault(), Fault::kDeviceSilent);
  EXPECT_EQ(loop_->faults(), 1u);
  // the watchdog's 20 ms end in the 21st silent tick
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

TEST_F(ServoFault, missedTicksDuringAFaultAreCountedAsUsual) {
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

TEST_F(ServoFault, theDevicesConditionIsReadableFromOutside) {
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

TEST_F(ServoFault, crashStopRemovesForceWithin20MsAndEndsTheLoop) {
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
    // The recording contains the reason.
    EXPECT_EQ(samples_[360].fault, static_cast<std::uint8_t>(Fault::kProgramTrouble));
  }
}

TEST_F(ServoFault, crashStopEndsAFaultsWaitAndKeepsTheFirstCause) {
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
