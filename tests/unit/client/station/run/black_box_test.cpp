#include "client/station/run/black_box.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tests/support/no_alloc.h"

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

TEST_F(BlackBoxTest, keepsWhatThereIsWhenTheTriggerComesEarlyOrTheLoopEnds) {
  ticks(10);
  tick(true);
  ticks(2);
  box_.finish();
  ASSERT_TRUE(take());
  expectTicks(0, 12);
}

TEST_F(BlackBoxTest, aSecondTriggerInTheSameStretchMakesItLongerUpToHalfASecond) {
  ticks(300);
  tick(true);
  ticks(3);
  tick(true);  // tick 304: 5 more after it
  ticks(5);
  ASSERT_TRUE(take());
  expectTicks(100, 309);
  EXPECT_EQ(dump_.triggers, 2u);

  // a storm: one in every tick
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
  EXPECT_EQ(box_.notKept(), 4u);
}

TEST_F(BlackBoxTest, aReaderThatIsAwayFindsItsStretchWholeAndTheRestIsCounted) {
  ticks(300);
  tick(true);
  ticks(1000);
  // the ring held 350: from tick 100 on, up to tick 449
  EXPECT_EQ(box_.ticksRefused(), 1301u - 450u);
  ASSERT_TRUE(take());
  expectTicks(100, 305);
  // and the loop goes on at once
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
  // every value of a tick is its number: a tick that is half overwritten would show
  BlackBox box(kBoxRate_hz, 32);
  std::atomic<bool> done{false};
  std::uint64_t seen = 0;
  std::thread reader([&] {
    BlackBoxDump dump;
    std::vector<BlackBoxTick> kept;
    for (bool last = false; !last;) {
      last = done.load(std::memory_order_acquire);
      while (box.take(dump, kept)) {
        // a reader that falls behind finds several triggers in one stretch
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
  EXPECT_EQ(seen + box.notKept(), box.triggers());
  EXPECT_EQ(box.triggers(), 30u);
}

TEST(MissedTickStorm, twentyMsAtOnceOrBitByBitAndOnceUntilItIsOver) {
  MissedTickStorm storm(1000);
  for (int i = 0; i < 5000; ++i) ASSERT_FALSE(storm.note(i % 21 == 0 ? 1 : 0)) << "one in 21 is forgiven";
  EXPECT_FALSE(storm.note(9)) << "what a virtual machine does now and then";
  for (int i = 0; i < 1000; ++i) ASSERT_FALSE(storm.note(0));
  EXPECT_TRUE(storm.note(30));
  EXPECT_FALSE(storm.note(30)) << "the same storm";
  for (int i = 0; i < 1500; ++i) ASSERT_FALSE(storm.note(0));
  // every fifth tick: 1 − 6·0.05 = 0.7 more with each, above 20 after 29 of them
  int ticks = 0;
  while (!storm.note(ticks % 5 == 4 ? 1 : 0) && ticks < 1000) ++ticks;
  EXPECT_NEAR(ticks, 145, 10);
}

}  // namespace
}  // namespace needlelab::test
