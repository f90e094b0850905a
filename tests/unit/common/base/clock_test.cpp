#include "common/base/clock.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(Clock, steadyTimeNeverGoesBack) {
  std::int64_t last = steadyNowNs();
  const std::int64_t start = last;
  while (last - start < 2'000'000) {  // 2 ms: it does advance, or the test hangs and times out
    const std::int64_t now = steadyNowNs();
    ASSERT_GE(now, last);
    last = now;
  }
}

TEST(Clock, wallTimeIsInThisCentury) {
  EXPECT_GT(wallNowNs(), 1'700'000'000'000'000'000);  // November 2023
  EXPECT_LT(wallNowNs(), 4'102'444'800'000'000'000);  // 2100
}

}  // namespace
}  // namespace needlelab
