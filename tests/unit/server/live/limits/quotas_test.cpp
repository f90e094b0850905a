#include "server/live/limits/quotas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace needlelab {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr std::int64_t kMinute_ns = 60'000'000'000, kHour_ns = 60 * kMinute_ns;
constexpr std::uint64_t kRows = StationQuotas::kChunkRowBytes, kMebi = 1u << 20;

StationQuotas quotas() {
  return StationQuotas({.open_sessions = 5,
                        .description_bytes = 240'000,
                        .unknown_names = 24,
                        .chunk_bytes = 240.0 * kMebi,
                        .undecodable_bytes = 24.0 * kMebi});
}

/// How often `admit` accepts until it refuses for lack of room with `texts` (one after the other).
template <typename Admit>
int admitted(const Admit& admit, const std::vector<std::string>& texts) {
  for (int times = 0; times < 100'000; ++times) {
    const Status status = admit();
    if (status.ok()) continue;
    EXPECT_EQ(status.error().code, ErrorCode::kNoRoom) << "a station asks again: nothing is lost";
    std::size_t at = 0;
    for (const std::string& text : texts) {
      EXPECT_NE(at = status.error().message.find(text, at), std::string::npos)
          << text << " in: " << status.error().message;
      if (at == std::string::npos) break;
    }
    return times;
  }
  return 100'000;
}

/// Sends chunks of 1 MiB with their rows until one is refused.
int chunksTaken(StationQuotas& all, const std::string& station, std::int64_t now_ns, bool undecodable = false,
                const std::vector<std::string>& texts = {}) {
  return admitted(
      [&] { return all.admitChunk(station, {.bytes = kMebi - kRows, .undecodable = undecodable}, now_ns); },
      texts);
}

TEST(Quotas, aStationMayHaveSoManySessionsOpen) {
  StationQuotas all = quotas();
  std::uint64_t open = 0;
  const auto admit = [&] { return all.admit("s1", {.open_sessions = open++}, 0); };
  EXPECT_EQ(admitted(admit, {"'s1'", "5 open sessions", "station revoke", "keeps the session"}), 5);
}

// Each share of a station recovers within a day, is separate, and never exceeds its full size.
TEST(Quotas, eachShareIsThereOnceAndComesBackWithinADay) {
  struct Row {
    const char* what;
    StationQuotas::NewSession session;
    int at_once, in_an_hour;
    std::vector<std::string> texts;
  };
  const Row rows[] = {
      {"profiles", {.description_bytes = 10'000}, 24, 1, {"profiles", "this one has 10000 bytes", "60 min"}},
      {"names", {.unknown_name = true}, 24, 1, {"24 names", "user add", "60 min"}},
  };
  for (const Row& row : rows) {
    SCOPED_TRACE(row.what);
    StationQuotas all = quotas();
    const auto taken = [&](const char* station, std::int64_t now_ns) {
      return admitted([&] { return all.admit(station, row.session, now_ns); },
                      now_ns == 0 ? row.texts : std::vector<std::string>());
    };
    EXPECT_EQ(taken("s1", 0), row.at_once);
    EXPECT_EQ(taken("s2", 0), row.at_once) << "another has its own";
    EXPECT_EQ(taken("s1", kHour_ns - 1'000'000'000), 0);
    EXPECT_EQ(taken("s1", kHour_ns), row.in_an_hour);
    EXPECT_EQ(taken("s1", 100 * kHour_ns), row.at_once);
    EXPECT_TRUE(all.admit("s1", {}, 100 * kHour_ns).ok()) << "what takes nothing of it continues";
  }
}

TEST(Quotas, whatIsRefusedCostsNothing) {
  StationQuotas all = quotas();
  for (int i = 0; i < 10; ++i)
    EXPECT_FALSE(all.admit("s1", {.description_bytes = 240'001, .unknown_name = true}, 0).ok());
  for (int i = 0; i < 24; ++i)
    EXPECT_TRUE(all.admit("s1", {.description_bytes = 10'000, .unknown_name = true}, 0).ok()) << i;
}

TEST(Quotas, theChunkQuotaRefillsInADayAndABacklogPasses) {
  StationQuotas all = quotas();
  EXPECT_EQ(chunksTaken(all, "s1", 0, false, {"'s1'", "240 MiB of recordings", "6 min", "keeps the session"}),
            240);
  const auto large = [&] { return all.admitChunk("s1", {.bytes = 10 * kMebi - kRows}, 0); };
  EXPECT_EQ(admitted(large, {"60 min"}), 0);
  EXPECT_EQ(chunksTaken(all, "s2", 0), 240);
  int delivered = 240;
  std::int64_t hours = 1;
  for (; delivered < 1200; ++hours) {
    EXPECT_EQ(chunksTaken(all, "s1", hours * kHour_ns), 10);
    delivered += 10;
  }
  EXPECT_EQ(hours, 97);
  EXPECT_EQ(chunksTaken(all, "s1", 200 * kHour_ns), 240) << "never more than a share";
}

TEST(Quotas, openingASessionNeedsRoomForSeveralChunks) {
  StationQuotas all = quotas();
  EXPECT_TRUE(all.roomForChunks("s1", 0).ok());
  ASSERT_EQ(chunksTaken(all, "s1", 0), 240);
  // 1/256 of a day is 5.625 min
  EXPECT_EQ(admitted([&] { return all.roomForChunks("s1", 0); }, {"6 min"}), 0);
  EXPECT_FALSE(all.roomForChunks("s1", 5 * kMinute_ns).ok());
  EXPECT_TRUE(all.roomForChunks("s1", 6 * kMinute_ns).ok());
  EXPECT_TRUE(all.roomForChunks("s2", 0).ok());
}

TEST(Quotas, undecodableChunksHaveASmallerQuotaAndSoundOnesPass) {
  StationQuotas all = quotas();
  EXPECT_EQ(chunksTaken(all, "s1", 0, true, {"24 MiB", "cannot be decoded"}), 24);
  EXPECT_EQ(chunksTaken(all, "s1", 0), 216) << "they count among all, and those refused cost nothing";
}

TEST(Quotas, manySmallChunksCostTheirRows) {
  StationQuotas all({.chunk_bytes = 100.0 * (kRows + 64)});
  EXPECT_EQ(admitted([&] { return all.admitChunk("s1", {.bytes = 64}, 0); }, {}), 100);
}

TEST(Quotas, aFullSpoolAndADayOfLessonsFitTheQuota) {
  StationQuotas all;
  for (int i = 0; i < 4096; ++i) ASSERT_TRUE(all.admitChunk("s1", {.bytes = kMebi - 1024}, 0).ok()) << i;
  ASSERT_TRUE(all.roomForChunks("s1", 0).ok());
  // 4 kHz day and night, a chunk of 30 kB each second
  for (std::int64_t s = 0; s < 86'400; ++s)
    ASSERT_TRUE(all.admitChunk("s1", {.bytes = 30'000}, s * 1'000'000'000).ok()) << s;
}

TEST(Quotas, aStolenKeyBringsAtMostTwoSharesInADay) {
  StationQuotas all;
  const StationLimits limits;
  double profiles = 0, undecodable = 0, sound = 0;
  for (std::int64_t minute = 0; minute < 24 * 60; ++minute) {
    const std::int64_t now_ns = minute * kMinute_ns;
    profiles +=
        250'000 * admitted([&] { return all.admit("s1", {.description_bytes = 250'000}, now_ns); }, {});
    undecodable += chunksTaken(all, "s1", now_ns, true) * static_cast<double>(kMebi);
  }
  for (std::int64_t minute = 24 * 60; minute < 48 * 60; ++minute)
    sound += chunksTaken(all, "s1", minute * kMinute_ns) * static_cast<double>(kMebi);
  EXPECT_LE(profiles, 2 * limits.description_bytes);
  EXPECT_GT(profiles, 1.9 * limits.description_bytes) << "and a station that has so much to deliver may";
  EXPECT_LE(undecodable, 2 * limits.undecodable_bytes);
  EXPECT_LE(undecodable + sound, 2 * limits.chunk_bytes + 2 * limits.undecodable_bytes);
}

constexpr std::size_t kCost = PeopleShares::kRequestBytes;

TEST(PeopleShares, eachRoleHasItsShareAndRequestsCostBytesAndRows) {
  struct Row {
    const char* name;
    pb::Role role;
    std::size_t bytes;
    int admitted;
  };
  const Row rows[] = {
      {"tina", pb::TRAINEE, 0, 24},      {"rea", pb::RESEARCHER, 0, 24},
      {"ina", pb::INSTRUCTOR, 0, 48},    {"mia", pb::CURRICULUM_MANAGER, 0, 48},
      {"ada", pb::ADMINISTRATOR, 0, 96}, {"tom", pb::TRAINEE, kCost, 12},
  };
  PeopleShares all(
      {.own_bytes = 24.0 * kCost, .staff_bytes = 48.0 * kCost, .administrator_bytes = 96.0 * kCost});
  for (const std::int64_t now_ns : {0 * kHour_ns, 30 * 24 * kHour_ns})
    for (const Row& row : rows)
      EXPECT_EQ(admitted([&] { return all.admit(row.name, row.role, row.bytes, now_ns); }, {}), row.admitted)
          << row.name;
}

TEST(PeopleShares, aRefusalStatesTheShareAndRetryTimeAndCostsNothing) {
  PeopleShares all({.own_bytes = 24.0 * kMebi});
  const auto at = [&](std::int64_t now_ns) {
    return [&all, now_ns] { return all.admit("tina", pb::TRAINEE, kMebi - kCost, now_ns); };
  };
  EXPECT_EQ(admitted(at(0), {"this account", "24 MiB", "in 60 min"}), 24);
  EXPECT_EQ(admitted(at(0), {"in 60 min"}), 0);
  EXPECT_EQ(admitted(at(59 * kMinute_ns), {}), 0);
  EXPECT_EQ(admitted(at(60 * kMinute_ns), {}), 1);
}

TEST(PeopleShares, ordinaryWorkIsNeverRefused) {
  PeopleShares all;
  // an administrator imports a lab of 2 GiB in pieces, a manager 5,000 profiles, a trainee changes their mind
  for (int i = 0; i < 4096; ++i) ASSERT_TRUE(all.admit("ada", pb::ADMINISTRATOR, 512u << 10, 0).ok()) << i;
  for (int i = 0; i < 5000; ++i) ASSERT_TRUE(all.admit("mia", pb::CURRICULUM_MANAGER, 20'000, 0).ok()) << i;
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(all.admit("tina", pb::TRAINEE, 1100, 0).ok()) << i;
}

}  // namespace
}  // namespace needlelab
