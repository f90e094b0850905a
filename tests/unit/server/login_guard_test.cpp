#include "server/login_guard.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

constexpr std::int64_t kS = 1'000'000'000;
using std::chrono::milliseconds;

LoginGuard::Settings settings() {
  LoginGuard::Settings s;
  s.allowed_per_name = 3;
  s.allowed_per_address = 6;
  s.refill_name = milliseconds(10'000);
  s.refill_address = milliseconds(2'000);
  return s;
}

TEST(LoginGuard, afterThreeFailuresTheNameWaits) {
  LoginGuard guard(settings());
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(guard.mustWait("anna", "a", 0).count(), 0) << i;
    guard.failed("anna", "a", 0);
  }
  EXPECT_EQ(guard.mustWait("anna", "a", 0), milliseconds(10'000));
  EXPECT_EQ(guard.mustWait("anna", "b", 0), milliseconds(10'000)) << "from everywhere";
  EXPECT_EQ(guard.mustWait("bert", "a", 0).count(), 0) << "others are not concerned";
  EXPECT_EQ(guard.mustWait("anna", "a", 4 * kS), milliseconds(6'000));
  EXPECT_EQ(guard.mustWait("anna", "a", 10 * kS).count(), 0);
}

TEST(LoginGuard, guessingManyNamesFromOneAddressWaitsToo) {
  LoginGuard guard(settings());
  for (int i = 0; i < 6; ++i) guard.failed("name" + std::to_string(i), "a", 0);
  EXPECT_EQ(guard.mustWait("fresh", "a", 0), milliseconds(2'000));
  EXPECT_EQ(guard.mustWait("fresh", "b", 0).count(), 0);
}

TEST(LoginGuard, overAnHourNoMoreTriesPassThanTheRefillGives) {
  LoginGuard guard(settings());
  int tries = 0;
  for (std::int64_t t = 0; t < 3600 * kS; t += kS / 10) {
    if (guard.mustWait("anna", "a", t).count() > 0) continue;
    guard.failed("anna", "a", t);
    ++tries;
  }
  // 3 at once, then one each 10 s
  EXPECT_LE(tries, 3 + 360);
  EXPECT_GE(tries, 350);
}

TEST(LoginGuard, memoryIsBounded) {
  auto s = settings();
  s.max_entries = 100;
  LoginGuard guard(s);
  for (int i = 0; i < 10'000; ++i) guard.failed("n" + std::to_string(i), "a" + std::to_string(i), 0);
  EXPECT_LE(guard.entries(), 200u);
}

}  // namespace
}  // namespace needlelab
