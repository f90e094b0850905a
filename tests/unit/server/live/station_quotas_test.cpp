#include "server/live/station_quotas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace needlelab {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr std::int64_t kHour_ns = 3'600'000'000'000;

StationQuotas quotas() {
  return StationQuotas({.open_sessions = 5, .description_bytes = 240'000, .unknown_names = 24});
}

TEST(StationQuotas, aStationMayHaveSoManySessionsOpen) {
  StationQuotas all = quotas();
  EXPECT_TRUE(all.admit("s1", {.open_sessions = 4}, 0).ok());
  const Status refused = all.admit("s1", {.open_sessions = 5}, 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("'s1'"), HasSubstr("5 open sessions"),
                                             HasSubstr("station revoke"), HasSubstr("keeps the session")));
}

TEST(StationQuotas, profilesAreAShareThatComesBackWithinADay) {
  StationQuotas all = quotas();
  for (int i = 0; i < 24; ++i) ASSERT_TRUE(all.admit("s1", {.description_bytes = 10'000}, 0).ok()) << i;
  const Status refused = all.admit("s1", {.description_bytes = 10'000}, 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("profiles"), HasSubstr("60 min")));
  // 10,000 bytes an hour come back
  EXPECT_FALSE(all.admit("s1", {.description_bytes = 10'000}, kHour_ns - 1'000'000'000).ok());
  EXPECT_TRUE(all.admit("s1", {.description_bytes = 10'000}, kHour_ns).ok());
  EXPECT_FALSE(all.admit("s1", {.description_bytes = 10'000}, kHour_ns).ok());
  for (int i = 0; i < 24; ++i)
    ASSERT_TRUE(all.admit("s1", {.description_bytes = 10'000}, 100 * kHour_ns).ok());
  EXPECT_FALSE(all.admit("s1", {.description_bytes = 10'000}, 100 * kHour_ns).ok())
      << "never more than a share";
}

TEST(StationQuotas, namesThatNobodyHasAreAShare) {
  StationQuotas all = quotas();
  for (int i = 0; i < 24; ++i) ASSERT_TRUE(all.admit("s1", {.unknown_name = true}, 0).ok());
  const Status refused = all.admit("s1", {.unknown_name = true}, 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message,
              AllOf(HasSubstr("24 names"), HasSubstr("user add"), HasSubstr("60 min")));
  EXPECT_TRUE(all.admit("s1", {.unknown_name = false}, 0).ok()) << "people who are known go on";
}

TEST(StationQuotas, whatIsRefusedCostsNothing) {
  StationQuotas all = quotas();
  for (int i = 0; i < 10; ++i)
    EXPECT_FALSE(all.admit("s1", {.description_bytes = 240'001, .unknown_name = true}, 0).ok());
  for (int i = 0; i < 24; ++i)
    EXPECT_TRUE(all.admit("s1", {.description_bytes = 10'000, .unknown_name = true}, 0).ok()) << i;
}

TEST(StationQuotas, oneStationDoesNotUseUpAnothers) {
  StationQuotas all = quotas();
  while (all.admit("s1", {.description_bytes = 10'000, .unknown_name = true}, 0).ok()) {
  }
  EXPECT_TRUE(all.admit("s2", {.description_bytes = 10'000, .unknown_name = true}, 0).ok());
}

TEST(StationQuotas, aStolenKeyBringsAtMostTwoSharesOfProfilesInADay) {
  StationQuotas all;
  const double share = StationQuotas::Settings{}.description_bytes;
  double brought = 0;
  for (std::int64_t minute = 0; minute <= 24 * 60; ++minute) {
    while (all.admit("s1", {.description_bytes = 250'000}, minute * kHour_ns / 60).ok()) brought += 250'000;
  }
  EXPECT_LE(brought, 2 * share);
  EXPECT_GT(brought, 1.9 * share) << "and a station that has so much to deliver may";
}

}  // namespace
}  // namespace needlelab
