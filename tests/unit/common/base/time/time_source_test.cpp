#include "common/base/time/time_source.h"

#include <gtest/gtest.h>

#include <csignal>
#include <thread>

#include "tests/support/blocked_signals.h"
#include "tests/support/time/fake_time.h"

namespace needlelab::test {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;

TEST(TimeSource, neverWakesBeforeTheDueTime) {
  TimeSource& time = machineTime();
  const std::int64_t due_ns = time.nowNs() + 2 * kMillisecond;
  time.sleepUntilNs(due_ns);
  EXPECT_GE(time.nowNs(), due_ns);
}

TEST(TimeSource, aWaitEndsAtItsDueTimeWithoutANotification) {
  TimeSource& time = machineTime();
  std::mutex mutex;
  std::condition_variable changed;
  std::unique_lock lock(mutex);
  const std::int64_t due_ns = time.nowNs() + 2 * kMillisecond;
  EXPECT_FALSE(time.waitUntilNs(changed, lock, due_ns, [] { return false; }));
  EXPECT_GE(time.nowNs(), due_ns);
  EXPECT_TRUE(lock.owns_lock());
}

TEST(TimeSource, aWaitEndsWithTheNotification) {
  TimeSource& time = machineTime();
  std::mutex mutex;
  std::condition_variable changed;
  bool told = false;
  std::thread other([&] {
    const std::scoped_lock lock(mutex);
    told = true;
    changed.notify_all();
  });
  {
    std::unique_lock lock(mutex);
    EXPECT_TRUE(time.waitUntilNs(changed, lock, INT64_MAX / 2, [&] { return told; }));
  }
  other.join();
}

// the signal comes before or during the wait; without it the wait would take an hour
TEST(TimeSource, aSignalEndsAWait) {
  const BlockedSignals blocked({SIGUSR1, SIGUSR2});
  TimeSource& time = machineTime();
  const std::int64_t due_ns = time.nowNs() + 3600 * 1000 * kMillisecond;
  std::thread other([owner = ::pthread_self()] { ::pthread_kill(owner, SIGUSR2); });
  EXPECT_EQ(time.waitForSignalUntilNs(blocked.set(), due_ns), SIGUSR2);
  EXPECT_LT(time.nowNs(), due_ns);
  other.join();
  // it was consumed
  EXPECT_EQ(time.waitForSignalUntilNs(blocked.set(), time.nowNs()), 0);
}

TEST(TimeSource, aWaitForASignalEndsAtItsDueTimeWithoutOne) {
  const BlockedSignals blocked({SIGUSR1});
  TimeSource& time = machineTime();
  const std::int64_t due_ns = time.nowNs() + 2 * kMillisecond;
  EXPECT_EQ(time.waitForSignalUntilNs(blocked.set(), due_ns), 0);
  EXPECT_GE(time.nowNs(), due_ns);
  EXPECT_EQ(time.waitForSignalUntilNs(blocked.set(), due_ns), 0) << "a time that has passed";
}

TEST(FakeTime, sleepsMoveItToTheDueTimeAndNeverBack) {
  FakeTime time(1000);
  time.sleepUntilNs(5000);
  EXPECT_EQ(time.nowNs(), 5000);
  time.sleepUntilNs(3000);
  EXPECT_EQ(time.nowNs(), 5000);
  time.sleepForNs(10);
  EXPECT_EQ(time.nowNs(), 5010);
  time.advance(90);
  EXPECT_EQ(time.nowNs(), 5100);
  EXPECT_EQ(time.sleeps(), 3u);
}

TEST(FakeTime, sleepsEndLateAndReadingsTakeTimeWhereATestWantsIt) {
  FakeTime time(1000);
  time.late_ns[1] = 7;
  time.sleepUntilNs(2000);
  EXPECT_EQ(time.nowNs(), 2000);
  time.sleepUntilNs(3000);
  EXPECT_EQ(time.nowNs(), 3007);
  time.sleepUntilNs(4000);
  time.read_cost_ns = 5;
  EXPECT_EQ(time.nowNs(), 4005);
  EXPECT_EQ(time.nowNs(), 4010);
  EXPECT_EQ(time.peekNs(), 4010);
}

TEST(FakeTime, aWaitThatNothingEndsTakesItsWholeTime) {
  FakeTime time(1000);
  std::mutex mutex;
  std::condition_variable changed;
  std::unique_lock lock(mutex);
  EXPECT_FALSE(time.waitUntilNs(changed, lock, 9000, [] { return false; }));
  EXPECT_EQ(time.nowNs(), 9000);
  EXPECT_TRUE(time.waitUntilNs(changed, lock, 20'000, [] { return true; }));
  EXPECT_EQ(time.nowNs(), 9000);
}

TEST(FakeTime, aPendingSignalEndsAWaitBeforeItBegins) {
  const BlockedSignals blocked({SIGUSR1});
  FakeTime time(1000);
  ::raise(SIGUSR1);
  EXPECT_EQ(time.waitForSignalUntilNs(blocked.set(), 9000), SIGUSR1);
  EXPECT_EQ(time.nowNs(), 1000);
  EXPECT_EQ(time.waitForSignalUntilNs(blocked.set(), 9000), 0);
  EXPECT_EQ(time.nowNs(), 9000);
  EXPECT_EQ(time.sleeps(), 1u);
}

TEST(FakeTime, aSignalDuringAWaitArrivesAtItsEnd) {
  class Interrupted final : public FakeTime {
   public:
    void sleepUntilNs(std::int64_t due_ns) noexcept override {
      FakeTime::sleepUntilNs(due_ns);
      ::raise(SIGUSR1);
    }
  } time;
  const BlockedSignals blocked({SIGUSR1});
  const std::int64_t due_ns = time.nowNs() + 50 * kMillisecond;
  EXPECT_EQ(time.waitForSignalUntilNs(blocked.set(), due_ns), SIGUSR1);
  EXPECT_EQ(time.nowNs(), due_ns);
}

}  // namespace
}  // namespace needlelab::test
