#include "client/net/backoff.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace needlelab {
namespace {

using std::chrono::milliseconds;

TEST(Backoff, waitsLieBetweenHalfAndAllOfTheExponential) {
  Backoff backoff(1, {milliseconds(200), milliseconds(10'000), 2.0});
  for (int n = 0; n < 40; ++n) {
    const double all = std::min(10'000.0, 200.0 * (n < 30 ? 1 << n : 1 << 30));
    const auto wait = static_cast<double>(backoff.next().count());
    EXPECT_GE(wait, 0.5 * all - 1) << n;
    EXPECT_LE(wait, all) << n;
  }
}

TEST(Backoff, resetStartsAgainFromTheFirst) {
  Backoff backoff(1);
  for (int i = 0; i < 10; ++i) (void)backoff.next();
  backoff.reset();
  EXPECT_LE(backoff.next(), milliseconds(200));
}

TEST(Backoff, aSeedAlwaysGivesTheSameWaits) {
  Backoff a(7), b(7);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(a.next(), b.next());
}

TEST(Backoff, aThousandStationsDoNotComeBackTogether) {
  // after 5 failures the waits of 1,000 seeds are spread over 3.2–6.4 s: no 100 ms get more than twice their
  // share
  std::vector<int> buckets(64, 0);
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    Backoff backoff(seed);
    for (int i = 0; i < 5; ++i) (void)backoff.next();
    ++buckets[static_cast<std::size_t>(backoff.next().count() / 100)];
  }
  EXPECT_LT(*std::max_element(buckets.begin(), buckets.end()), 2 * 1000 / 32);
}

}  // namespace
}  // namespace needlelab
