#include "server/live/limits/token_bucket.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace needlelab {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000, kAnHour_ns = 3600 * kSecond_ns;

int takenAt(TokenBuckets& buckets, const std::string& owner, const BucketRate& rate, std::int64_t now_ns,
            double amount = 1) {
  int taken = 0;
  while (taken < 10'000 && buckets.take(owner, rate, amount, now_ns)) ++taken;
  return taken;
}

TEST(TokenBucket, allowsABurstThenTheRateAndRefusalsCostNothing) {
  struct Row {
    BucketRate rate;
    double amount;
    std::int64_t now_ns;
    int taken;
  };
  const BucketRate messages{50, 5}, day = BucketRate::ofDay(240);
  const Row rows[] = {
      {messages, 1, 0, 50},
      {messages, 1, 21 * kSecond_ns / 10, 10},
      {messages, 1, 100 * kSecond_ns, 50},
      {messages, 1, 100'000 * kSecond_ns, 50},  // never more than the burst
      {messages, 51, 200'000 * kSecond_ns, 0},
      {day, 10, 300'000 * kSecond_ns, 24},
      {day, 10, 300'000 * kSecond_ns + kAnHour_ns - kSecond_ns, 0},
      {day, 10, 300'000 * kSecond_ns + kAnHour_ns, 1},
      {day, 10, 300'000 * kSecond_ns + 100 * kAnHour_ns, 24},
  };
  TokenBuckets buckets;
  for (const Row& row : rows)
    EXPECT_EQ(takenAt(buckets, "bench", row.rate, row.now_ns, row.amount), row.taken) << row.now_ns;
}

TEST(TokenBucket, saysWhenThereIsRoomAndTakesBack) {
  TokenBucket bucket{BucketRate::ofDay(24)};
  bucket.take(24, 0);
  EXPECT_FALSE(bucket.has(1, 0));
  EXPECT_DOUBLE_EQ(bucket.secondsUntil(1, 0), 3600);
  EXPECT_EQ(bucket.minutesUntil(1, 0), 60);
  EXPECT_EQ(bucket.minutesUntil(1, kAnHour_ns - 1), 1);
  bucket.take(-1, 0);
  EXPECT_TRUE(bucket.has(1, 0));
  bucket.take(-100, 0);
  EXPECT_EQ(bucket.usedAt(0), 0);
}

// The finding: each log-in got a new burst of 5,000 messages, at 2 ms.
TEST(TokenBucket, aNewLogInKeepsItsBucketAndOwnersAreSeparate) {
  TokenBuckets buckets;
  const BucketRate rate{50, 5};
  EXPECT_EQ(takenAt(buckets, "station bench", rate, 0), 50);
  EXPECT_EQ(takenAt(buckets, "station bench", rate, 0), 0);
  EXPECT_EQ(takenAt(buckets, "person bench", rate, 0), 50);
}

TEST(TokenBucket, thoseThatAreEmptyAreForgottenAndNoOthers) {
  TokenBuckets buckets, slow;
  for (std::int64_t n = 0; n < 10'000; ++n) {
    // one message each; the bucket has recovered by the next one
    EXPECT_TRUE(buckets.take("station " + std::to_string(n), {50, 50}, 1, n * kSecond_ns));
    ASSERT_LE(buckets.known(), TokenBuckets::kLeast);
  }
  for (const bool again : {false, true})
    for (int n = 0; n < 1000; ++n)
      EXPECT_EQ(slow.take("station " + std::to_string(n), {1, 1e-9}, 1, 0), !again) << n;
}

// A share per day: constant requests get at most two of them.
TEST(TokenBucket, ofADayGivesTwoSharesInADay) {
  TokenBuckets buckets;
  const double share = 8 << 20, piece = 3148;
  double taken = 0;
  for (std::int64_t minute = 0; minute <= 24 * 60; ++minute)
    taken += piece * takenAt(buckets, "tina", BucketRate::ofDay(share), minute * 60 * kSecond_ns, piece);
  EXPECT_LE(taken, 2 * share + 1);
  EXPECT_GT(taken, 1.9 * share);
}

}  // namespace
}  // namespace needlelab
