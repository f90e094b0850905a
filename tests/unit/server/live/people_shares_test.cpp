#include "server/live/people_shares.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace needlelab {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr std::int64_t kMinute_ns = 60'000'000'000, kDay_ns = 24 * 60 * kMinute_ns;
constexpr std::size_t kCost = PeopleShares::kRequestBytes;

/// Shares of 24, 48 and 96 requests without bytes of their own.
PeopleShares shares() {
  return PeopleShares(
      {.own_bytes = 24.0 * kCost, .staff_bytes = 48.0 * kCost, .administrator_bytes = 96.0 * kCost});
}

int admitted(PeopleShares& all, const std::string& name, pb::Role role, std::size_t bytes,
             std::int64_t now_ns) {
  int times = 0;
  while (times < 10'000 && all.admit(name, role, bytes, now_ns).ok()) ++times;
  return times;
}

TEST(PeopleShares, eachRoleHasItsShareAndARequestCostsItsBytesAndItsRows) {
  PeopleShares all = shares();
  EXPECT_EQ(admitted(all, "tina", pb::TRAINEE, 0, 0), 24);
  EXPECT_EQ(admitted(all, "rea", pb::RESEARCHER, 0, 0), 24);
  EXPECT_EQ(admitted(all, "ina", pb::INSTRUCTOR, 0, 0), 48);
  EXPECT_EQ(admitted(all, "mia", pb::CURRICULUM_MANAGER, 0, 0), 48);
  EXPECT_EQ(admitted(all, "ada", pb::ADMINISTRATOR, 0, 0), 96);
  EXPECT_EQ(admitted(all, "tom", pb::TRAINEE, kCost, 0), 12);
}

TEST(PeopleShares, aRefusalSaysTheShareAndWhenThereIsRoomAndCostsNothing) {
  PeopleShares all({.own_bytes = 24.0 * 1024 * 1024});
  const std::size_t mebibyte = (1u << 20) - kCost;
  EXPECT_EQ(admitted(all, "tina", pb::TRAINEE, mebibyte, 0), 24);
  for (int i = 0; i < 10; ++i) {
    const Status refused = all.admit("tina", pb::TRAINEE, mebibyte, 0);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
    EXPECT_THAT(refused.error().message,
                AllOf(HasSubstr("'tina'"), HasSubstr("24 MiB"), HasSubstr("in 60 min")));
  }
  EXPECT_FALSE(all.admit("tina", pb::TRAINEE, mebibyte, 59 * kMinute_ns).ok());
  EXPECT_TRUE(all.admit("tina", pb::TRAINEE, mebibyte, 60 * kMinute_ns).ok());
  EXPECT_FALSE(all.admit("tina", pb::TRAINEE, mebibyte, 60 * kMinute_ns).ok());
}

TEST(PeopleShares, oneAccountDoesNotUseUpAnothersAndNoneSavesMoreThanItsShare) {
  PeopleShares all = shares();
  EXPECT_EQ(admitted(all, "tina", pb::TRAINEE, 0, 0), 24);
  EXPECT_EQ(admitted(all, "tom", pb::TRAINEE, 0, 0), 24);
  EXPECT_EQ(admitted(all, "tina", pb::TRAINEE, 0, 30 * kDay_ns), 24);
}

TEST(PeopleShares, aTraineeWhoAsksWithoutEndHasAtMostTwoSharesStoredInADay) {
  PeopleShares all;
  constexpr std::size_t kLongest = 1100;  // a consent with a note of 1,000 bytes
  double stored = 0;
  for (std::int64_t minute = 0; minute < 24 * 60; ++minute)
    stored += admitted(all, "tina", pb::TRAINEE, kLongest, minute * kMinute_ns) *
              static_cast<double>(kLongest + kCost);
  EXPECT_LE(stored, 2 * PeopleShares::Settings{}.own_bytes);
  EXPECT_GT(stored, 1.9 * PeopleShares::Settings{}.own_bytes);
}

TEST(PeopleShares, ordinaryWorkIsNeverRefused) {
  PeopleShares all;
  // an administrator brings a lab of 2 GiB in pieces, a manager 5,000 profiles, a trainee thinks it over
  for (int i = 0; i < 4096; ++i) ASSERT_TRUE(all.admit("ada", pb::ADMINISTRATOR, 512u << 10, 0).ok()) << i;
  for (int i = 0; i < 5000; ++i) ASSERT_TRUE(all.admit("mia", pb::CURRICULUM_MANAGER, 20'000, 0).ok()) << i;
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(all.admit("tina", pb::TRAINEE, 1100, 0).ok()) << i;
}

}  // namespace
}  // namespace needlelab
