#include "db/service/context/code_guard.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/time/fake_time.h"

namespace needlelab {
namespace {

using Seconds = std::chrono::seconds;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

TEST(CodeGuard, letsFiveTriesPassAndThenOneAfterEachWait) {
  test::FakeTime time;
  CodeGuard guard(time);
  for (unsigned left = 4; left > 0; --left) {
    const auto begun = guard.begin("tom");
    EXPECT_EQ(begun.must_wait, Seconds(0));
    EXPECT_EQ(begun.left, left);
    EXPECT_EQ(begun.then_wait, Seconds(0));
  }
  // the fifth and each further one starts a wait: 1, 2, 4, 8, at most 15 minutes
  for (const int minutes : {1, 2, 4, 8, 15, 15, 15}) {
    const auto begun = guard.begin("tom");
    EXPECT_EQ(begun.must_wait, Seconds(0)) << minutes;
    EXPECT_EQ(begun.left, 0u);
    EXPECT_EQ(begun.then_wait, Seconds(60 * minutes));
    EXPECT_EQ(guard.begin("tom").must_wait, Seconds(60 * minutes));
    time.advance(60 * minutes * kSecond_ns - 1);
    EXPECT_EQ(guard.begin("tom").must_wait, Seconds(1)) << "rounded up";
    EXPECT_EQ(guard.begin("tim").must_wait, Seconds(0)) << "another person";
    guard.forget("tim");
    time.advance(1);
  }
}

TEST(CodeGuard, aCorrectCodeResetsTheCount) {
  test::FakeTime time;
  CodeGuard guard(time);
  for (int i = 0; i < 4; ++i) (void)guard.begin("tom");
  guard.forget("tom");
  EXPECT_EQ(guard.entries(), 0u);
  EXPECT_EQ(guard.begin("tom").left, 4u);
}

TEST(CodeGuard, aTryThatCouldNotBeCheckedDoesNotCount) {
  test::FakeTime time;
  CodeGuard guard(time);
  for (int i = 0; i < 4; ++i) (void)guard.begin("tom");
  for (int i = 0; i < 10; ++i) {
    const auto fifth = guard.begin("tom");
    EXPECT_EQ(fifth.must_wait, Seconds(0));
    EXPECT_EQ(fifth.then_wait, Seconds(60)) << "if it is wrong";
    guard.giveBack("tom");
  }
  (void)guard.begin("tom");
  EXPECT_EQ(guard.begin("tom").must_wait, Seconds(60));
  guard.giveBack("nobody");
  EXPECT_EQ(guard.entries(), 1u);
}

TEST(CodeGuard, countsATryFromItsBeginning) {
  test::FakeTime time;
  CodeGuard guard(time);
  // six at once, before one is checked: the sixth is not tried
  for (int i = 0; i < 5; ++i) EXPECT_EQ(guard.begin("tom").must_wait, Seconds(0));
  EXPECT_EQ(guard.begin("tom").must_wait, Seconds(60));
  // one of them was right
  guard.forget("tom");
  EXPECT_EQ(guard.begin("tom").must_wait, Seconds(0));
}

TEST(CodeGuard, forgetsWhoWasIdleForLongestWhenItIsFull) {
  test::FakeTime time;
  CodeGuard::Settings settings;
  settings.max_entries = 3;
  CodeGuard guard(time, settings);
  for (const char* name : {"a", "b", "c"}) {
    (void)guard.begin(name);
    time.advance(kSecond_ns);
  }
  (void)guard.begin("a");
  time.advance(kSecond_ns);
  EXPECT_EQ(guard.begin("d").left, 4u);
  EXPECT_EQ(guard.entries(), 3u);
  EXPECT_EQ(guard.begin("a").left, 2u) << "kept";
  EXPECT_EQ(guard.begin("b").left, 4u) << "forgotten";
}

/// The rate stated in the header: finding a six-digit PIN takes some 5,000 days on average.
TEST(CodeGuard, aGuesserHasSomeHundredTriesADay) {
  test::FakeTime time;
  CodeGuard guard(time);
  const std::int64_t end_ns = time.nowNs() + 86'400 * kSecond_ns;
  int tries = 0;
  while (time.nowNs() < end_ns) {
    const auto begun = guard.begin("tom");
    if (begun.must_wait.count() == 0) ++tries;
    time.advance(std::max<std::int64_t>(begun.must_wait.count(), 1) * kSecond_ns);
  }
  EXPECT_GE(tries, 95);
  EXPECT_LE(tries, 110);
}

TEST(WaitText, roundsMinutesUp) {
  EXPECT_EQ(waitText(Seconds(1)), "1 s");
  EXPECT_EQ(waitText(Seconds(59)), "59 s");
  EXPECT_EQ(waitText(Seconds(60)), "1 min");
  EXPECT_EQ(waitText(Seconds(61)), "2 min");
  EXPECT_EQ(waitText(Seconds(900)), "15 min");
}

}  // namespace
}  // namespace needlelab
