#include "server/live/limits/disk_room.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
constexpr std::uint64_t kMiB = 1u << 20;

/// Levels after checks of a disk with this many MiB, in order.
std::vector<RoomLevel> levelsOf(const std::vector<std::uint64_t>& looks_MiB, std::uint64_t floor_MiB = 64) {
  DiskRoom room(floor_MiB * kMiB);
  std::vector<RoomLevel> levels;
  for (const std::uint64_t MiB : looks_MiB) {
    room.look({.disk_bytes = MiB * kMiB});
    levels.push_back(room.level());
  }
  return levels;
}
constexpr auto kPlenty = RoomLevel::kPlenty, kNoNew = RoomLevel::kNoNewSessions, kNone = RoomLevel::kNoChunks;

TEST(DiskRoom, refusesFirstNewSessionsThenChunks) {
  EXPECT_EQ(levelsOf({1000, 256, 255, 64, 63, 0}),
            (std::vector{kPlenty, kPlenty, kNoNew, kNoNew, kNone, kNone}));
}

TEST(DiskRoom, itsLastFloorIsAnEighthOfTheFloor) {
  DiskRoom room(64 * kMiB), without(0);
  EXPECT_FALSE(room.atLastFloor()) << "before the first look";
  for (const auto& [MiB, at_last] : {std::pair{63u, false}, {8u, false}, {7u, true}, {8u, false}}) {
    room.look({.disk_bytes = MiB * kMiB});
    EXPECT_EQ(room.atLastFloor(), at_last) << MiB;
  }
  // each byte is written twice
  room.look({.disk_bytes = 10 * kMiB});
  room.take(kMiB);
  EXPECT_FALSE(room.atLastFloor());
  room.take(1);
  EXPECT_TRUE(room.atLastFloor());
  without.look({});
  EXPECT_FALSE(without.atLastFloor());
}

TEST(DiskRoom, goesBackWithAQuarterMoreThanTheFloor) {
  EXPECT_EQ(levelsOf({63, 64, 79, 81, 256, 319, 321}),
            (std::vector{kNone, kNone, kNone, kNoNew, kNoNew, kNoNew, kPlenty}));
  EXPECT_EQ(levelsOf({0, 10'000}), (std::vector{kNone, kPlenty}));
}

TEST(DiskRoom, withoutAFloorNothingIsRefused) {
  DiskRoom room(0);
  room.look({});
  room.take(UINT64_MAX / 8);
  EXPECT_EQ(room.level(), kPlenty);
  EXPECT_THAT(room.text(), IsEmpty());
}

TEST(DiskRoom, nothingIsRefusedBeforeTheFirstLook) {
  DiskRoom room(64 * kMiB);
  room.take(kMiB);
  EXPECT_EQ(room.level(), kPlenty);
}

TEST(DiskRoom, aFloodBetweenTwoLooksDoesNotReachTheFloor) {
  DiskRoom room(64 * kMiB);
  room.look({.disk_bytes = 300 * kMiB});
  std::uint64_t taken = 0;
  while (room.level() != kNone) {
    room.take(kMiB);
    taken += kMiB;
  }
  // each byte is written twice: 300 − 2 · 119 = 62
  EXPECT_EQ(taken, 119 * kMiB);
  EXPECT_LE(300 * kMiB - 2 * taken, 64 * kMiB);
  EXPECT_GT(300 * kMiB - 2 * (taken - kMiB), 63 * kMiB);
}

TEST(DiskRoom, whatWasTakenDuringALookIsNotForgotten) {
  DiskRoom room(64 * kMiB);
  room.look({.disk_bytes = 300 * kMiB});
  room.share(50 * kMiB).stored();  // not yet on the disk at the next check
  room.look({.disk_bytes = 300 * kMiB});
  EXPECT_EQ(room.leftBytes(), 200 * kMiB);
  EXPECT_EQ(room.level(), kNoNew);
  room.look({.disk_bytes = 200 * kMiB});
  EXPECT_EQ(room.leftBytes(), 200 * kMiB) << "the look has it now";
}

// The finding: refused requests of 1 MB counted until the second check after them, so one instructor blocked
// new sessions; and the resulting level was left only with a quarter more than its threshold.
TEST(DiskRoom, aLevelThatOnlyRefusedRequestsReachedIsLeftWithThem) {
  DiskRoom room(64 * kMiB);
  room.look({.disk_bytes = 293 * kMiB});
  room.take(40 * kMiB);
  EXPECT_EQ(room.level(), kNoNew) << "it may be stored: 293 - 2 * 40 = 213";
  room.look({.disk_bytes = 293 * kMiB});
  EXPECT_EQ(room.level(), kNoNew) << "no one knows yet";
  room.look({.disk_bytes = 293 * kMiB});
  EXPECT_EQ(room.leftBytes(), 213 * kMiB) << "however long it takes";
  room.settle(40 * kMiB, false);
  EXPECT_EQ(room.level(), kPlenty) << "and not only with 320";
  // for stored data the level is left only with a quarter more
  room.take(40 * kMiB);
  room.settle(40 * kMiB, true);
  EXPECT_EQ(room.level(), kNoNew);
  for (int looks = 0; looks < 2; ++looks) room.look({.disk_bytes = 293 * kMiB});
  EXPECT_EQ(room.leftBytes(), 293 * kMiB);
  EXPECT_EQ(room.level(), kNoNew);
}

TEST(DiskRoom, aShareIsTransientUnlessMarkedStored) {
  DiskRoom room(64 * kMiB);
  room.look({.disk_bytes = 300 * kMiB});
  const auto left_MiB = [&] { return room.leftBytes() / kMiB; };
  {
    DiskRoom::Share refused = room.share(kMiB), stored = room.share(2 * kMiB), none;
    EXPECT_EQ(left_MiB(), 294u);
    none = std::move(refused);
    EXPECT_EQ(left_MiB(), 294u) << "another has it";
    stored.stored();
    stored.stored();
    EXPECT_EQ(left_MiB(), 294u);
  }
  EXPECT_EQ(left_MiB(), 296u);
}

TEST(DiskRoom, freePagesOfTheFileAreRoomWhileTheLogMayGrow) {
  DiskRoom room(64 * kMiB);
  room.look({.disk_bytes = 20 * kMiB, .file_bytes = 500 * kMiB});
  EXPECT_EQ(room.level(), kPlenty) << "retention made room";
  room.look({.disk_bytes = 7 * kMiB, .file_bytes = 500 * kMiB});
  EXPECT_EQ(room.level(), kNone) << "the log cannot grow";
}

TEST(DiskRoom, reportsFreeAndRequestedSpaceWithAdvice) {
  DiskRoom room(64 * kMiB);
  room.look({.disk_bytes = 100 * kMiB});
  EXPECT_THAT(room.text(), testing::AllOf(HasSubstr("100 MiB"), HasSubstr("256 MiB"), HasSubstr("make room"),
                                          HasSubstr("the station keeps its data")));
  room.look({.disk_bytes = 10 * kMiB});
  EXPECT_THAT(room.text(), testing::AllOf(HasSubstr("disk is full"), HasSubstr("10 MiB"), HasSubstr("64 MiB"),
                                          HasSubstr("retention"), HasSubstr("the station keeps its data")));
}

TEST(DiskRoom, theSystemReportsFreeSpace) {
  const test::TempFolder folder;
  EXPECT_GT(freeBytesOf(folder.path()).value_or(0), 0u);
  EXPECT_FALSE(freeBytesOf(folder.path() / "none").has_value());
}

}  // namespace
}  // namespace needlelab
