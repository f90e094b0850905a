// When a channel's limits expire: exact, on times given by the test.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "common/wire/channel.h"

namespace needlelab {
namespace {

constexpr std::int64_t kMilli = 1'000'000, kStart = 5'000 * kMilli;

/// A channel after handshake and log-in that waits for its peer; it sent and received at kStart.
ChannelTimes quiet() {
  ChannelTimes times;
  times.made_ns = times.last_received_ns = times.last_sent_ns = kStart;
  times.handshaken = times.established = times.reading = true;
  return times;
}

struct LimitCase {
  const char* name;
  ChannelTimes times;
  ChannelLimits limits;
  std::int64_t limit_ms;
  ChannelDue due;
};

std::vector<LimitCase> cases() {
  std::vector<LimitCase> all;
  ChannelLimits no_ping;
  no_ping.keepalive = std::chrono::milliseconds(0);
  ChannelTimes times = quiet();
  all.push_back({"a peer that sends nothing", times, no_ping, 30'000, ChannelDue::kIdle});
  all.push_back({"we send nothing", times, {}, 10'000, ChannelDue::kPing});
  times.established = false;
  all.push_back({"no log-in", times, no_ping, 10'000, ChannelDue::kHandshake});
  times.handshaken = times.reading = false;
  all.push_back({"no TLS handshake", times, {}, 10'000, ChannelDue::kHandshake});
  times = quiet();
  times.write_started_ns = kStart;
  all.push_back({"a peer that reads nothing", times, {}, 10'000, ChannelDue::kWriteTimeout});
  times.finishing = true;
  times.finish_started_ns = kStart;
  all.push_back({"a close that does not end", times, {}, 1'000, ChannelDue::kCut});
  return all;
}

TEST(ChannelTimes, eachLimitIsOverOneNanosecondAfterItsTimeAndNotBefore) {
  for (const LimitCase& each : cases()) {
    EXPECT_EQ(dueAt(kStart, each.times, each.limits), ChannelDue::kNothing) << each.name;
    EXPECT_EQ(dueAt(kStart + each.limit_ms * kMilli, each.times, each.limits), ChannelDue::kNothing)
        << each.name;
    EXPECT_EQ(dueAt(kStart + each.limit_ms * kMilli + 1, each.times, each.limits), each.due) << each.name;
  }
}

TEST(ChannelTimes, theWatchDetectsEachLimitAtMostAQuarterLate) {
  for (const LimitCase& each : cases()) {
    // the watch as the channel runs it: it checks, then sleeps for the period
    std::int64_t now = kStart;
    while (dueAt(now, each.times, each.limits) == ChannelDue::kNothing)
      now += std::chrono::nanoseconds(watchPeriod(each.times, each.limits)).count();
    const double late_ms = static_cast<double>(now - kStart) / 1e6 - static_cast<double>(each.limit_ms);
    EXPECT_GT(late_ms, 0) << each.name;
    EXPECT_LE(late_ms, static_cast<double>(each.limit_ms) / 4) << each.name;
    EXPECT_LE(late_ms, 2'500) << each.name;
  }
}

TEST(ChannelTimes, receivingIsNotIdleAndSendingNeedsNoPing) {
  ChannelTimes times = quiet();
  const std::int64_t later = kStart + 40'000 * kMilli;
  ASSERT_NE(dueAt(later, times, {}), ChannelDue::kNothing);
  times.last_received_ns = later - 30'000 * kMilli;
  EXPECT_EQ(dueAt(later, times, {}), ChannelDue::kPing);
  times.last_sent_ns = later - 10'000 * kMilli;
  EXPECT_EQ(dueAt(later, times, {}), ChannelDue::kNothing);
}

TEST(ChannelTimes, aChannelThatIsNotReadIsNotIdle) {
  ChannelTimes times = quiet();
  times.reading = false;  // its owner is busy, and the bytes may be waiting in the kernel
  times.last_sent_ns = kStart + 30'000 * kMilli;
  EXPECT_EQ(dueAt(kStart + 31'000 * kMilli, times, {}), ChannelDue::kNothing);
}

TEST(ChannelTimes, aPingIsNeverDueWhenKeepaliveIsOff) {
  ChannelLimits limits;
  limits.keepalive = std::chrono::milliseconds(0);
  limits.idle_timeout = std::chrono::hours(24);
  EXPECT_EQ(dueAt(kStart + 3'600'000 * kMilli, quiet(), limits), ChannelDue::kNothing);
}

TEST(ChannelTimes, theEarliestExceededLimitIsReported) {
  ChannelTimes times = quiet();
  times.write_started_ns = kStart;
  EXPECT_EQ(dueAt(kStart + 60'000 * kMilli, times, {}), ChannelDue::kWriteTimeout);
  times.established = false;
  EXPECT_EQ(dueAt(kStart + 60'000 * kMilli, times, {}), ChannelDue::kHandshake);
}

}  // namespace
}  // namespace needlelab
