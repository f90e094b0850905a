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

constexpr std::uint64_t kRows = StationQuotas::kChunkRowBytes, kMebi = 1u << 20;

/// Brings chunks of 1 MiB with their rows until one is refused. Returns how many.
int chunksTaken(StationQuotas& all, const std::string& station, std::int64_t now_ns,
                bool undecodable = false) {
  int taken = 0;
  while (all.admitChunk(station, {.bytes = kMebi - kRows, .undecodable = undecodable}, now_ns).ok()) ++taken;
  return taken;
}

StationQuotas chunkQuotas() {
  return StationQuotas({.chunk_bytes = 240.0 * kMebi, .undecodable_bytes = 24.0 * kMebi});
}

TEST(StationQuotas, chunksAreAShareThatComesBackWithinADay) {
  StationQuotas all = chunkQuotas();
  EXPECT_EQ(chunksTaken(all, "s1", 0), 240);
  const Status refused = all.admitChunk("s1", {.bytes = 10 * kMebi - kRows}, 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom) << "a station asks again: nothing is lost";
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("'s1'"), HasSubstr("240 MiB of recordings"),
                                             HasSubstr("60 min"), HasSubstr("keeps the session")));
  EXPECT_EQ(chunksTaken(all, "s2", 0), 240);
  // 10 MiB an hour come back
  EXPECT_EQ(chunksTaken(all, "s1", kHour_ns), 10);
  EXPECT_EQ(chunksTaken(all, "s1", 100 * kHour_ns), 240) << "never more than a share";
}

TEST(StationQuotas, aBacklogOfAnySizeGetsThroughShareByShare) {
  StationQuotas all = chunkQuotas();
  int delivered = 0;
  std::int64_t hours = 0;
  for (; delivered < 1200; ++hours) delivered += chunksTaken(all, "s1", hours * kHour_ns);
  EXPECT_EQ(hours, 97) << "a whole share at once, then 10 MiB an hour for 96 hours";
}

TEST(StationQuotas, aSessionIsOpenedOnlyWithRoomForMoreThanAFewChunks) {
  StationQuotas all = chunkQuotas();
  EXPECT_TRUE(all.roomForChunks("s1", 0).ok());
  ASSERT_EQ(chunksTaken(all, "s1", 0), 240);
  const Status refused = all.roomForChunks("s1", 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
  // 1/256 of a day are 5.625 min
  EXPECT_THAT(refused.error().message, HasSubstr("6 min"));
  EXPECT_FALSE(all.roomForChunks("s1", 5 * kHour_ns / 60).ok());
  EXPECT_TRUE(all.roomForChunks("s1", 6 * kHour_ns / 60).ok());
  EXPECT_TRUE(all.roomForChunks("s2", 0).ok());
}

TEST(StationQuotas, chunksThatCannotBeDecodedAreASmallerShareAndSoundOnesGoOn) {
  StationQuotas all = chunkQuotas();
  EXPECT_EQ(chunksTaken(all, "s1", 0, true), 24);
  const Status refused = all.admitChunk("s1", {.bytes = kMebi - kRows, .undecodable = true}, 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("24 MiB"), HasSubstr("cannot be decoded")));
  EXPECT_EQ(chunksTaken(all, "s1", 0), 216) << "they count among all, and those refused cost nothing";
}

TEST(StationQuotas, manySmallChunksCostTheirRows) {
  StationQuotas all({.chunk_bytes = 100.0 * (kRows + 64)});
  int taken = 0;
  while (all.admitChunk("s1", {.bytes = 64}, 0).ok()) ++taken;
  EXPECT_EQ(taken, 100);
}

TEST(StationQuotas, aStationWithAFullSpoolAndADayOfLessonsIsNotRefused) {
  StationQuotas all;
  for (int i = 0; i < 4096; ++i) ASSERT_EQ(all.admitChunk("s1", {.bytes = kMebi - 1024}, 0).ok(), true) << i;
  ASSERT_TRUE(all.roomForChunks("s1", 0).ok());
  // 4 kHz day and night, each second a chunk of 30 kB
  for (std::int64_t s = 0; s < 86'400; ++s)
    ASSERT_TRUE(all.admitChunk("s1", {.bytes = 30'000}, s * 1'000'000'000).ok()) << s;
}

TEST(StationQuotas, aStolenKeyBringsAtMostTwoSharesOfChunksInADay) {
  StationQuotas all;
  double brought = 0;
  for (std::int64_t minute = 0; minute < 24 * 60; ++minute)
    brought += chunksTaken(all, "s1", minute * kHour_ns / 60, true) * static_cast<double>(kMebi);
  EXPECT_LE(brought, 2 * StationQuotas::Settings{}.undecodable_bytes);
  for (std::int64_t minute = 24 * 60; minute < 48 * 60; ++minute)
    brought += chunksTaken(all, "s1", minute * kHour_ns / 60) * static_cast<double>(kMebi);
  EXPECT_LE(brought,
            2 * StationQuotas::Settings{}.chunk_bytes + 2 * StationQuotas::Settings{}.undecodable_bytes);
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
