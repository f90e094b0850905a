#include "common/base/time/clock.h"

#include <gtest/gtest.h>

#include <chrono>

#include "tests/support/time_zone.h"

namespace needlelab {
namespace {

TEST(Clock, wallTimeIsThatOfTheLibraryInNanoseconds) {
  const auto library_ns = [] {
    return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
  };
  const std::int64_t before_ns = library_ns(), ours_ns = wallNowNs(), after_ns = library_ns();
  EXPECT_GE(ours_ns, before_ns);
  EXPECT_LE(ours_ns, after_ns);
}

TEST(Timing, ofRunsIsTheMedianOfEachQuantile) {
  // medians 2, 12, 22, 32, 42; slowest 100, 14, 24, 34, 44
  const Timing timing =
      timingOfRuns({3, 100, 1, 2, 14, 13, 12, 11, 22, 21, 24, 23, 31, 34, 33, 32, 44, 41, 42, 43}, 10, 5);
  EXPECT_EQ(timing.median_ns, 22);
  EXPECT_EQ(timing.p99_ns, 34);
  EXPECT_EQ(timing.min_ns, 1);
  EXPECT_EQ(timing.batches, 20u);
  EXPECT_EQ(timing.per_batch, 10u);
}

TEST(Timing, ofFewRunsHasNoTailBelowItsMedian) {
  // runs of 1, 1, 2, 1 and 2; over all seven the median is 80, longer than most runs' tails
  const Timing timing = timingOfRuns({10, 11, 90, 80, 12, 95, 85}, 1, 5);
  EXPECT_EQ(timing.median_ns, 12);
  EXPECT_EQ(timing.p99_ns, 12);
}

TEST(Timing, ofFewerValuesThanRunsHasARunForEach) {
  const Timing timing = timingOfRuns({5, 3}, 1, 5);
  EXPECT_EQ(timing.median_ns, 3);
  EXPECT_EQ(timing.p99_ns, 3);
  EXPECT_EQ(timingOfRuns({}, 1, 5).p99_ns, 0);
}

constexpr std::int64_t kSecond = 1'000'000'000, kHour = 3600 * kSecond;
// 2026-07-01 12:04:56 UTC and 2026-01-01 02:00:00 UTC, by counting days since 1970
constexpr std::int64_t kSummer = (20635LL * 86400 + 12 * 3600 + 4 * 60 + 56) * kSecond + 999'999'999;
constexpr std::int64_t kWinter = (20454LL * 86400 + 2 * 3600) * kSecond;

TEST(LocalTime, isTheZonesInSummerAndInWinter) {
  const test::WithZone zone(test::kStJohns);
  // 2 h 30 min behind UTC in summer
  EXPECT_EQ(localTime(kSummer, TimeForm::kDay), "2026-07-01");
  EXPECT_EQ(localTime(kSummer, TimeForm::kMinute), "2026-07-01 09:34");
  EXPECT_EQ(localTime(kSummer, TimeForm::kClock), "09:34:56");
  EXPECT_EQ(localTime(kSummer, TimeForm::kWords), "1 July 2026, 09:34");
  EXPECT_EQ(localTime(kWinter, TimeForm::kWords), "31 December 2025, 22:30");
  EXPECT_EQ(localTime(kSummer, TimeForm::kZoned), "2026-07-01 09:34:56 NDT");
  // 3 h 30 min in winter: still the old year
  EXPECT_EQ(localTime(kWinter, TimeForm::kDay), "2025-12-31");
  EXPECT_EQ(localTime(kWinter, TimeForm::kZoned), "2025-12-31 22:30:00 NST");
  EXPECT_EQ(utcTime(kWinter), "2026-01-01 02:00:00 UTC") << "what is stored knows no zone";
  EXPECT_EQ(isoTime(kSummer), "2026-07-01T12:04:56Z");
  EXPECT_EQ(isoTime(0), "");
  EXPECT_EQ(spreadsheetTime(kSummer), "2026-07-01 12:04:56");
  EXPECT_EQ(spreadsheetTime(0), "");
  EXPECT_EQ(isoTimeMs(kSummer), "2026-07-01T12:04:56.999Z");
  EXPECT_EQ(isoTimeMs(kWinter + 7'000'000), "2026-01-01T02:00:00.007Z");
  EXPECT_EQ(isoTimeMs(-1), "1969-12-31T23:59:59.999Z");
  EXPECT_EQ(isoTimeMs(0), "");
}

TEST(LocalTime, followsTzAndSaysUtcWhereItApplies) {
  const test::WithZone zone("UTC");
  EXPECT_EQ(localTime(kSummer, TimeForm::kZoned), "2026-07-01 12:04:56 UTC");
  const test::WithZone other(test::kStJohns);
  EXPECT_EQ(localTime(kSummer, TimeForm::kClock), "09:34:56");
}

TEST(LocalTime, neverIsAStrokeAndBefore1970RoundsDown) {
  const test::WithZone zone("UTC");
  EXPECT_EQ(localTime(0, TimeForm::kMinute), "-");
  EXPECT_EQ(localTime(-1, TimeForm::kZoned), "1969-12-31 23:59:59 UTC");
  EXPECT_EQ(localTime(-kSecond, TimeForm::kClock), "23:59:59");
}

TEST(LocalTime, aDayBeginsAtItsMidnightAndLasts23To25Hours) {
  const test::WithZone zone(test::kStJohns);
  const std::int64_t july = 20635LL * 24 * kHour + 2 * kHour + kHour / 2;
  EXPECT_EQ(localMidnightNs(2026, 7, 1), july);
  EXPECT_EQ(localMidnightNs(2026, 6, 31), july) << "one beyond the month's last";
  const auto hours = [](int month, int day) {
    return (localMidnightNs(2026, month, day + 1) - localMidnightNs(2026, month, day)) / kHour;
  };
  EXPECT_EQ(hours(3, 8), 23);
  EXPECT_EQ(hours(7, 1), 24);
  EXPECT_EQ(hours(11, 1), 25);
}

}  // namespace
}  // namespace needlelab
