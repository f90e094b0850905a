#include "server/live/login/login_guard.h"

#include <gtest/gtest.h>

#include <string>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::int64_t kS = 1'000'000'000;
using std::chrono::milliseconds;

LoginGuard::Settings guardSettings() {
  LoginGuard::Settings s;
  s.allowed_per_name = 3;
  s.first_wait = milliseconds(10'000);
  s.longest_wait = milliseconds(60'000);
  s.allowed_per_address = 6;
  s.refill_address = milliseconds(2'000);
  s.allowed_everywhere = 8;
  s.refill_everywhere = milliseconds(5'000);
  return s;
}

TEST(LoginGuard, afterThreeFailuresTheNameWaitsAtThisAddress) {
  LoginGuard guard(guardSettings());
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(guard.mustWait("anna", "a", 0).count(), 0) << i;
    EXPECT_EQ(guard.failed("anna", "a", 0), i == 2) << "the third one begins a wait: worth noting once";
  }
  EXPECT_EQ(guard.mustWait("anna", "a", 0), milliseconds(10'000));
  EXPECT_EQ(guard.mustWait("anna", "b", 0).count(), 0) << "not elsewhere";
  EXPECT_EQ(guard.mustWait("bert", "a", 0).count(), 0) << "others are not concerned";
  EXPECT_EQ(guard.mustWait("anna", "a", 4 * kS), milliseconds(6'000));
  EXPECT_EQ(guard.mustWait("anna", "a", 10 * kS).count(), 0);
}

TEST(LoginGuard, eachFurtherFailureDoublesTheWaitUpToTheLongest) {
  LoginGuard guard(guardSettings());
  std::int64_t now = 0;
  for (int i = 0; i < 3; ++i) (void)guard.failed("anna", "a", now);
  for (const int expected_s : {10, 20, 40, 60, 60}) {
    EXPECT_EQ(guard.mustWait("anna", "a", now), milliseconds(1000 * expected_s));
    now += expected_s * kS;
    EXPECT_EQ(guard.mustWait("anna", "a", now).count(), 0);
    (void)guard.failed("anna", "a", now);
  }
}

TEST(LoginGuard, aSuccessOrAQuietHourResetsTheCount) {
  LoginGuard guard(guardSettings());
  for (int i = 0; i < 2; ++i) (void)guard.failed("anna", "a", 0);
  guard.succeeded("anna", "a", 0);
  for (int i = 0; i < 2; ++i) (void)guard.failed("anna", "a", kS);
  EXPECT_EQ(guard.mustWait("anna", "a", kS).count(), 0);
  (void)guard.failed("anna", "a", kS);
  EXPECT_GT(guard.mustWait("anna", "a", kS).count(), 0);
  (void)guard.failed("anna", "a", kS + 3601 * kS);
  EXPECT_EQ(guard.mustWait("anna", "a", kS + 3601 * kS).count(), 0);
}

TEST(LoginGuard, guessingManyNamesFromOneAddressWaitsToo) {
  LoginGuard guard(guardSettings());
  for (int i = 0; i < 6; ++i) (void)guard.failed("name" + std::to_string(i), "a", 0);
  EXPECT_EQ(guard.mustWait("fresh", "a", 0), milliseconds(2'000));
  EXPECT_EQ(guard.mustWait("fresh", "b", 0).count(), 0);
}

TEST(LoginGuard, guessingOneNameFromManyAddressesWaitsToo) {
  LoginGuard guard(guardSettings());
  for (int i = 0; i < 8; ++i) (void)guard.failed("anna", "bot" + std::to_string(i), 0);
  EXPECT_EQ(guard.mustWait("anna", "fresh", 0), milliseconds(5'000));
  EXPECT_EQ(guard.mustWait("bert", "fresh", 0).count(), 0);
}

TEST(LoginGuard, anOutsiderCannotLockATeacherOutOfTheLab) {
  LoginGuard guard(guardSettings());
  guard.succeeded("anna", "lab", 0);
  for (std::int64_t t = 0; t < 600 * kS; t += kS)
    for (int i = 0; i < 20; ++i) (void)guard.failed("anna", "bot" + std::to_string(i), t);
  EXPECT_GT(guard.mustWait("anna", "bot99", 600 * kS).count(), 0);
  EXPECT_EQ(guard.mustWait("anna", "lab", 600 * kS).count(), 0);
}

TEST(LoginGuard, aGuesserInTheLabDoesNotLockOutKnownPeople) {
  LoginGuard guard(guardSettings());
  guard.succeeded("anna", "lab", 0);
  for (int i = 0; i < 1000; ++i) (void)guard.failed("name" + std::to_string(i % 7), "lab", 0);
  EXPECT_GT(guard.mustWait("stranger", "lab", 0).count(), 0);
  EXPECT_EQ(guard.mustWait("anna", "lab", 0).count(), 0);
  // The cost stated in the header: guessing her name from her own address.
  for (int i = 0; i < 3; ++i) (void)guard.failed("anna", "lab", 0);
  EXPECT_EQ(guard.mustWait("anna", "lab", 0), milliseconds(10'000));
}

TEST(LoginGuard, anAddressIsKnownOnceAnybodyHasLoggedInThere) {
  LoginGuard guard(guardSettings());
  (void)guard.failed("anna", "lab", 0);
  EXPECT_FALSE(guard.knowsAddress("lab"));
  guard.succeeded("bert", "lab", 0);
  EXPECT_TRUE(guard.knowsAddress("lab"));
  EXPECT_FALSE(guard.knowsAddress("elsewhere"));
  EXPECT_FALSE(guard.knows("anna", "lab"));
}

TEST(LoginGuard, overADayFewTriesPass) {
  LoginGuard guard;  // as configured for users
  int tries = 0;
  for (std::int64_t t = 0; t < 86'400 * kS; t += kS) {
    if (guard.mustWait("anna", "a", t).count() > 0) continue;
    (void)guard.failed("anna", "a", t);
    ++tries;
  }
  // 5 at once, waits of 10, 20 … 640 s, then one per 15 minutes: 5 + 7 + (86400 − 1270) / 900
  EXPECT_LE(tries, 5 + 7 + 95);
  EXPECT_GE(tries, 5 + 7 + 93);
}

TEST(LoginGuard, noNameLooksLikeAnotherOneElsewhere) {
  LoginGuard guard(guardSettings());
  for (int i = 0; i < 3; ++i) (void)guard.failed("anna a", "b", 0);
  EXPECT_EQ(guard.mustWait("anna", "a b", 0).count(), 0);
}

// The finding: names of a megabyte were kept until the next start.
TEST(LoginGuard, impossibleNamesCountAsOneAndAreNotKept) {
  LoginGuard guard(guardSettings());
  for (int i = 0; i < 3; ++i) (void)guard.failed(std::string(100'000, static_cast<char>('a' + i)), "lab", 0);
  EXPECT_EQ(guard.entries(), 3u) << "a name at an address, a name, an address";
  EXPECT_GT(guard.mustWait(std::string(100, 'z'), "lab", 0).count(), 0);
}

// The finding: with the prefix for the kind the longest names were too long, so all of them counted as one.
TEST(LoginGuard, theLongestNamesCountEachForItself) {
  LoginGuard guard(guardSettings());
  const auto person = [](char letter) { return "person " + std::string(kMaxNameBytes, letter); };
  for (int i = 0; i < 3; ++i) (void)guard.failed(person('a'), "lab", 0);
  EXPECT_GT(guard.mustWait(person('a'), "lab", 0).count(), 0);
  EXPECT_EQ(guard.mustWait(person('b'), "lab", 0).count(), 0);
  guard.succeeded(person('b'), "lab", 0);
  EXPECT_GT(guard.mustWait(person('a'), "lab", 0).count(), 0);
}

TEST(LoginGuard, memoryIsBoundedAndAFloodKeepsALockedName) {
  auto s = guardSettings();
  s.max_entries = 100;
  LoginGuard guard(s);
  for (int i = 0; i < 1000; ++i) {
    (void)guard.failed("n" + std::to_string(i), "a" + std::to_string(i), i);
    guard.succeeded("k" + std::to_string(i), "a" + std::to_string(i), i);
    (void)guard.failed("anna", "a", i);  // it was never idle for long
  }
  EXPECT_LE(guard.entries(), 500u);
  EXPECT_GT(guard.mustWait("anna", "a", 1000).count(), 0);
}

}  // namespace
}  // namespace needlelab
