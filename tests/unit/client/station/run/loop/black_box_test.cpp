#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "client/station/run/loop/black_box.h"
#include "common/base/text/csv.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/station/run/loop/loop_fixture.h"

namespace needlelab::test {
namespace {

constexpr double kBoxRate_hz = 100;  // 200 ticks before, 5 after, at most 50 after; 350 in the ring

class BlackBoxTest : public testing::Test {
 protected:
  void ticks(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) tick(false);
  }
  void tick(bool trigger) {
    BlackBoxTick& t = box_.next();
    t.tick = number_;
    if (trigger) box_.trigger(BlackBoxCause::kFault, Fault::kDeviceLost, number_);
    box_.commit();
    ++number_;
  }
  bool take() { return box_.take(dump_, ticks_); }
  void expectTicks(std::uint64_t first, std::uint64_t last) {
    ASSERT_EQ(ticks_.size(), last - first + 1);
    for (std::size_t i = 0; i < ticks_.size(); ++i) ASSERT_EQ(ticks_[i].tick, first + i);
  }
  BlackBox box_{kBoxRate_hz, 3};
  std::uint64_t number_ = 0;
  BlackBoxDump dump_;
  std::vector<BlackBoxTick> ticks_;
};

TEST_F(BlackBoxTest, keepsTwoSecondsBeforeAnd50MsAfterATrigger) {
  ticks(1000);
  tick(true);
  ticks(4);
  EXPECT_FALSE(take()) << "the 50 ms after it are not over";
  ticks(1);
  ASSERT_TRUE(take());
  expectTicks(800, 1005);
  EXPECT_EQ(dump_.number, 1u);
  EXPECT_EQ(dump_.tick, 1000u);
  EXPECT_EQ(dump_.fault, Fault::kDeviceLost);
  EXPECT_EQ(dump_.triggers, 1u);
  EXPECT_FALSE(take());
}

TEST_F(BlackBoxTest, keepsTheAvailableTicksOnAnEarlyTriggerOrEnd) {
  ticks(10);
  tick(true);
  ticks(2);
  box_.finish();
  ASSERT_TRUE(take());
  expectTicks(0, 12);
}

TEST_F(BlackBoxTest, aSecondTriggerExtendsTheStretchToHalfASecond) {
  ticks(300);
  tick(true);
  ticks(3);
  tick(true);  // tick 304: 5 more after it
  ticks(5);
  ASSERT_TRUE(take());
  expectTicks(100, 309);
  EXPECT_EQ(dump_.triggers, 2u);

  // a storm: one per tick
  const std::uint64_t began = number_;
  for (int i = 0; i < 51; ++i) tick(true);
  ASSERT_TRUE(take());
  EXPECT_EQ(dump_.tick, began);
  EXPECT_EQ(dump_.triggers, 51u);
  EXPECT_EQ(ticks_.back().tick, began + 50);
  EXPECT_EQ(box_.triggers(), 53u);
}

TEST_F(BlackBoxTest, stretchesMayOverlap) {
  ticks(300);
  tick(true);
  ticks(30);
  tick(true);
  ticks(10);
  ASSERT_TRUE(take());
  expectTicks(100, 305);
  ASSERT_TRUE(take());
  expectTicks(131, 336);
}

TEST_F(BlackBoxTest, whatIsBeyondTheMostThatIsKeptIsCounted) {
  for (int i = 0; i < 7; ++i) {
    ticks(20);
    tick(true);
  }
  ticks(20);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(take());
  EXPECT_FALSE(take());
  EXPECT_EQ(box_.triggers(), 7u);
  EXPECT_EQ(box_.droppedDumps(), 4u);
}

TEST_F(BlackBoxTest, aDelayedReaderFindsItsStretchAndTheRestIsCounted) {
  ticks(300);
  tick(true);
  ticks(1000);
  // the ring held 350: from tick 100 on, up to tick 449
  EXPECT_EQ(box_.ticksRefused(), 1301u - 450u);
  ASSERT_TRUE(take());
  expectTicks(100, 305);
  // the loop continues at once
  ticks(300);
  tick(true);
  ticks(5);
  ASSERT_TRUE(take());
  EXPECT_EQ(ticks_.back().tick, number_ - 1);
  EXPECT_EQ(box_.ticksRefused(), 1301u - 450u);
}

TEST_F(BlackBoxTest, writingNeverTouchesTheHeap) {
  const NoAllocScope guard;
  for (int i = 0; i < 2000; ++i) tick(i % 100 == 0);
  box_.finish();
  EXPECT_EQ(guard.calls(), 0u);
}

TEST_F(BlackBoxTest, aReaderOnAnotherThreadSeesWholeTicksInOrder) {
  // Every value of a tick is its number, so a half-overwritten tick is visible.
  BlackBox box(kBoxRate_hz, 32);
  std::atomic<bool> done{false};
  std::uint64_t seen = 0;
  std::thread reader([&] {
    BlackBoxDump dump;
    std::vector<BlackBoxTick> kept;
    for (bool last = false; !last;) {
      last = done.load(std::memory_order_acquire);
      while (box.take(dump, kept)) {
        // A reader that falls behind finds several triggers in one span.
        seen += dump.triggers;
        for (std::size_t i = 0; i < kept.size(); ++i) {
          ASSERT_EQ(static_cast<double>(kept[i].tick), kept[i].reading.X_WH.p.x);
          ASSERT_EQ(static_cast<double>(kept[i].tick), kept[i].rendered_W.torque_Nm.z);
          if (i > 0) {
            ASSERT_GT(kept[i].tick, kept[i - 1].tick);
          }
        }
      }
      std::this_thread::yield();
    }
  });
  for (std::uint64_t n = 0; n < 60'000; ++n) {
    BlackBoxTick& t = box.next();
    t.tick = n;
    t.reading.X_WH.p.x = static_cast<double>(n);
    t.rendered_W.torque_Nm.z = static_cast<double>(n);
    if (n % 2000 == 1999) box.trigger(BlackBoxCause::kFault, Fault::kDeviceLost, n);
    box.commit();
    if (n % 500 == 0) std::this_thread::yield();
  }
  box.finish();
  done.store(true, std::memory_order_release);
  reader.join();
  EXPECT_EQ(seen + box.droppedDumps(), box.triggers());
  EXPECT_EQ(box.triggers(), 30u);
}

TEST(MissedTickStorm, twentyMissedMillisecondsTriggerOnceUntilTheStormEnds) {
  MissedTickStorm storm(1000);
  for (int i = 0; i < 5000; ++i) ASSERT_FALSE(storm.note(i % 21 == 0 ? 1 : 0)) << "one in 21 is forgiven";
  EXPECT_FALSE(storm.note(9)) << "what a virtual machine does now and then";
  for (int i = 0; i < 1000; ++i) ASSERT_FALSE(storm.note(0));
  EXPECT_TRUE(storm.note(30));
  EXPECT_FALSE(storm.note(30)) << "the same storm";
  for (int i = 0; i < 1500; ++i) ASSERT_FALSE(storm.note(0));
  // every fifth tick: each adds 1 − 6·0.05 = 0.7, so 29 of them exceed 20
  int ticks = 0;
  while (!storm.note(ticks % 5 == 4 ? 1 : 0) && ticks < 1000) ++ticks;
  EXPECT_NEAR(ticks, 145, 10);
}

using testing::HasSubstr;

// One thread steps the haptic loop and the writer on the same simulated time.
class BlackBoxWriterTest : public LoopFixture {
 protected:
  void say(const std::string& text) { said_ += text + "\n"; }
  BlackBoxWriter writer(BlackBox& box) {
    return BlackBoxWriter(
        box, folder_.path() / "black-box", "session", [this](const std::string& text) { say(text); }, time_,
        false);
  }
  // Call it in each tick: the writer polls at the time it announced.
  void lookWhenDue(BlackBoxWriter& files) {
    time_.advanceTo(clock_.peekNs());
    if (time_.nowNs() < look_due_ns_) return;
    look_due_ns_ = files.pass();
    ++looks_;
  }
  TempFolder folder_;
  std::string said_;
  FakeTime time_;
  std::int64_t look_due_ns_ = 0;
  std::uint64_t looks_ = 0;
};

TEST_F(BlackBoxWriterTest, looksEvery50ms) {
  BlackBox box(kRate);
  auto files = writer(box);
  EXPECT_EQ(files.pass(), time_.nowNs() + 50'000'000);
  time_.advance(50'000'000);
  EXPECT_EQ(files.pass(), time_.nowNs() + 50'000'000);
}

// a station runs for days: its memory must not grow with each incident
TEST_F(BlackBoxWriterTest, aLongerRangeNeedsNoMoreHeap) {
  BlackBox box(kRate);
  auto files = writer(box);
  std::uint64_t number = 0;
  const auto heapCallsOf = [&](std::uint64_t ticks, std::uint64_t triggers) {
    for (std::uint64_t i = 0; i < ticks; ++i) {
      BlackBoxTick& t = box.next();
      t.tick = number;
      t.due_ns = 1'763'685'600'000'000'000;
      t.X_WT.p = {0.1 / 3, -2e-7 / 3, 1e5 / 3};
      if (i + triggers >= ticks) box.trigger(BlackBoxCause::kFault, Fault::kDeviceLost, number);
      box.commit();
      ++number;
    }
    box.finish();
    const NoAllocScope watched;
    files.pass();
    return watched.calls();
  };
  heapCallsOf(10, 2);  // creates the folder
  const std::uint64_t brief = heapCallsOf(10, 2), longest = heapCallsOf(9000, 501);
  EXPECT_EQ(files.counts().files, 3u);
  EXPECT_EQ(longest, brief);
}

TEST_F(BlackBoxWriterTest, itsThreadWritesTheRestWhenFinished) {
  BlackBox box(kRate);
  BlackBoxWriter files(box, folder_.path() / "black-box", "session",
                       [this](const std::string& text) { say(text); });
  FakeDevice device(goingDown(0.002, kRate));
  clock_.late_ns[500] = 40 * kTick_ns;
  ServoSettings settings{kRate, {}, 1000};
  settings.black_box = &box;
  run(device, settings);
  files.finish();
  files.finish();
  EXPECT_EQ(files.counts().files, 1u);
}

// silent for 30 ms, and again 1.5 s later; outside the tissue after the first time
FakeDevice::Script twoStops() {
  return [](std::uint64_t tick, DeviceReading& reading) {
    goingDown(0.002, kRate)(tick, reading);
    reading.speed_mps = 0.25;
    if ((tick >= 2500 && tick < 2530) || (tick >= 4000 && tick < 4030)) return DeviceRead::kNoUpdate;
    if (tick >= 2600) reading.X_WH.p.z = 5e-3;
    return DeviceRead::kFresh;
  };
}

TEST_F(BlackBoxWriterTest, theLoopsFaultsBecomeFilesWithEverythingInThem) {
  BlackBox box(kRate);
  auto files = writer(box);
  FakeDevice device(twoStops());
  std::uint64_t first_at = 0;  // the tick when the first file appeared
  device.on_write = [&](std::uint64_t tick) {
    lookWhenDue(files);
    if (first_at == 0 && files.counts().files == 1) first_at = tick;
    if (tick == 2700) loop_->acknowledge();
  };
  clock_.read_cost_ns = 1000;
  clock_.late_ns[2400] = 3 * kTick_ns + 1;
  ServoSettings settings{kRate, {}, 5000, FaultPolicy::kWait};
  settings.black_box = &box;
  run(device, settings);
  files.finish();

  EXPECT_GE(looks_, 98u) << "in 5 s";
  EXPECT_LE(looks_, 100u);
  EXPECT_GT(first_at, 2570u) << "50 ms after the fault";
  EXPECT_LE(first_at, 2571u + 50u) << "at the next look";
  EXPECT_EQ(files.counts().files, 2u);
  EXPECT_EQ(files.counts().triggers, 2u);
  EXPECT_EQ(files.counts().not_written + files.counts().not_kept + files.counts().ticks_refused, 0u);
  const auto first = folder_.path() / "black-box" / "session-01.csv";
  EXPECT_THAT(said_, HasSubstr("black box 1: the device stopped reporting its position, at tick 2520"));
  EXPECT_THAT(said_, HasSubstr(first.string()));
  EXPECT_THAT(said_, HasSubstr("black box 2"));

  const auto table =
      readCsv(first, {"tick", "missed_before", "due_ns", "late_ns", "engine_ns", "fresh", "handle_speed_mps",
                      "p_WH_z_m", "p_WT_z_m", "q_WH_x", "wanted_force_W_z_N", "rendered_force_W_z_N",
                      "depth_m", "fault", "flags", "record_ns"});
  ASSERT_TRUE(table.ok()) << table.error().message;
  const auto at = [&](const char* name, std::size_t row) {
    return table->columns[static_cast<std::size_t>(table->find(name))][row];
  };
  // 2 s of executed ticks, the fault's own, and 50 after it
  ASSERT_EQ(table->rows(), 2051u);
  const std::size_t fault = 2000;
  EXPECT_EQ(at("tick", fault), 2520);
  EXPECT_EQ(at("fault", fault - 1), 0);
  EXPECT_EQ(at("fault", fault), static_cast<double>(Fault::kDeviceSilent));
  EXPECT_EQ(at("fresh", fault), 0);
  EXPECT_EQ(at("handle_speed_mps", 100), 0.25);
  for (std::size_t row = 1; row < table->rows(); ++row)
    ASSERT_EQ(at("tick", row), at("tick", row - 1) + 1 + at("missed_before", row));
  EXPECT_EQ(at("tick", 2000 - 117), 2403);
  EXPECT_EQ(at("missed_before", 2000 - 117), 3);
  EXPECT_GE(at("late_ns", 2000 - 117), 3e6);
  // the same values as in the recording, bit for bit
  for (std::size_t row = 0; row < table->rows(); ++row) {
    const auto sample = std::find_if(samples_.begin(), samples_.end(), [&](const GestureSample& s) {
      return static_cast<double>(s.tick) == at("tick", row);
    });
    ASSERT_NE(sample, samples_.end());
    ASSERT_EQ(sample->p_WT_m[2], at("p_WT_z_m", row));
    ASSERT_EQ(sample->force_W_N[2], at("rendered_force_W_z_N", row));
    ASSERT_EQ(static_cast<double>(sample->flags), at("flags", row));
    ASSERT_EQ(static_cast<double>(sample->time_ns), at("due_ns", row));
    ASSERT_EQ(static_cast<double>(sample->engine_ns), at("engine_ns", row));
  }
  // It contains the engine's force and the force after the gate.
  EXPECT_GT(at("wanted_force_W_z_N", fault + 30), 0.5);
  EXPECT_EQ(at("rendered_force_W_z_N", fault + 30), 0);
}

TEST_F(BlackBoxWriterTest, aStormOfMissedTicksIsKeptToo) {
  BlackBox box(kRate);
  auto files = writer(box);
  FakeDevice device(goingDown(0.002, kRate));
  clock_.late_ns[500] = 40 * kTick_ns;
  ServoSettings settings{kRate, {}, 1000};
  settings.black_box = &box;
  EXPECT_EQ(run(device, settings).faults, 0u);
  files.finish();
  EXPECT_EQ(files.counts().files, 1u);
  EXPECT_THAT(said_, HasSubstr("20 ms of ticks were missed"));
}

TEST_F(BlackBoxWriterTest, anUnwritableFolderIsReportedAndTheLoopContinues) {
  folder_.write("black-box", "a file is in the way");
  BlackBox box(kRate);
  auto files = writer(box);
  FakeDevice device(twoStops());
  ServoSettings settings{kRate, {}, 5000, FaultPolicy::kWait};
  settings.black_box = &box;
  EXPECT_EQ(run(device, settings).samples, 5000u);
  files.finish();
  EXPECT_EQ(files.counts().files, 0u);
  EXPECT_EQ(files.counts().not_written, 1u);
  EXPECT_THAT(said_, HasSubstr("it is not kept: "));
}

TEST_F(BlackBoxWriterTest, aStormOfFaultsLosesNothingSilently) {
  // a jump every 60 ms, acknowledged and outside each time: dozens of faults
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH = {{0, 0, 5e-3}, {1, 0, 0, 0}};
    reading.speed_mps = tick % 60 == 59 ? 100 : 0;
    return DeviceRead::kFresh;
  });
  BlackBox box(kRate, 4);
  auto files = writer(box);
  device.on_write = [&](std::uint64_t) {
    loop_->acknowledge();
    lookWhenDue(files);
  };
  ServoSettings settings{kRate, {}, 6000, FaultPolicy::kWait};
  settings.black_box = &box;
  const ServoStats& stats = run(device, settings);
  files.finish();
  EXPECT_EQ(stats.faults, 100u);
  const BlackBoxCounts counts = files.counts();
  EXPECT_EQ(counts.triggers, 100u);
  EXPECT_EQ(counts.files, 4u);
  EXPECT_EQ(counts.not_kept, 96u);
  EXPECT_EQ(counts.ticks_refused, 0u) << "the writer came in time";
  EXPECT_THAT(said_, HasSubstr("96 of 100 faults"));
}

TEST_F(BlackBoxWriterTest, oldBlackBoxesGoAndOthersStay) {
  const auto old = folder_.write("old-01.csv", "x"), fresh = folder_.write("new-01.csv", "x");
  const auto other = folder_.write("notes.txt", "x");
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(48);
  std::filesystem::last_write_time(old, long_ago);
  std::filesystem::last_write_time(other, long_ago);
  EXPECT_EQ(removeOldBlackBoxes(folder_.path(), 86'400), 1u);
  EXPECT_FALSE(std::filesystem::exists(old));
  EXPECT_TRUE(std::filesystem::exists(fresh) && std::filesystem::exists(other));
  EXPECT_EQ(removeOldBlackBoxes(folder_.path() / "not there", 0), 0u);
}

}  // namespace
}  // namespace needlelab::test
