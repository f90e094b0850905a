#include "common/base/time/clock.h"

#include <gtest/gtest.h>

#include <chrono>

namespace needlelab {
namespace {

TEST(Clock, steadyTimeNeverGoesBack) {
  std::int64_t last = steadyNowNs();
  const std::int64_t start = last;
  while (last - start < 2'000'000) {  // 2 ms: the clock does advance, or the test hangs and times out
    const std::int64_t now = steadyNowNs();
    ASSERT_GE(now, last);
    last = now;
  }
}

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

}  // namespace
}  // namespace needlelab
