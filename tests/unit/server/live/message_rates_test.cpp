#include "server/live/message_rates.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace needlelab {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

int takenAt(MessageBucket& bucket, std::int64_t now_ns, int messages) {
  int taken = 0;
  for (int i = 0; i < messages; ++i) taken += bucket.take(now_ns) ? 1 : 0;
  return taken;
}

TEST(MessageRates, soManyAtOnceThenSoManyASecond) {
  MessageRates rates(50, 5);
  const auto bench = rates.of("station bench", 0);
  EXPECT_EQ(takenAt(*bench, 0, 1000), 50);
  EXPECT_EQ(takenAt(*bench, 21 * kSecond_ns / 10, 1000), 10) << "what was refused filled nothing";
  EXPECT_EQ(takenAt(*bench, 100 * kSecond_ns, 1000), 50);
}

// The finding: each log-in had 5,000 messages at once, and costs 2 ms.
TEST(MessageRates, aLogInBeginsNoBucketAnewAndAnotherHasItsOwn) {
  MessageRates rates(50, 5);
  int taken = 0;
  for (int login = 0; login < 100; ++login) taken += takenAt(*rates.of("station bench", 0), 0, 50);
  EXPECT_EQ(taken, 50);
  EXPECT_EQ(takenAt(*rates.of("person bench", 0), 0, 1000), 50);
}

TEST(MessageRates, whoHasGoneAndWhoseBucketIsEmptyIsForgotten) {
  MessageRates rates(50, 50);
  const auto here = rates.of("station here", 0);
  for (int n = 0; n < 10'000; ++n) {
    // one message each, which has leaked with the next one
    EXPECT_EQ(takenAt(*rates.of("station " + std::to_string(n), n * kSecond_ns), n * kSecond_ns, 1), 1);
    ASSERT_LE(rates.known(), MessageRates::kLeast);
  }
  EXPECT_EQ(rates.of("station here", 10'000 * kSecond_ns), here);
}

TEST(MessageRates, whoseBucketIsNotEmptyIsNotForgotten) {
  MessageRates rates(1, 1e-9);
  for (int n = 0; n < 1000; ++n)
    EXPECT_EQ(takenAt(*rates.of("station " + std::to_string(n), 0), 0, 1), 1) << n;
  for (int n = 0; n < 1000; ++n)
    EXPECT_EQ(takenAt(*rates.of("station " + std::to_string(n), 0), 0, 1), 0) << n;
}

}  // namespace
}  // namespace needlelab
