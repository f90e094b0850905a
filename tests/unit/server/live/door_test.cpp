#include "server/live/door.h"

#include <gtest/gtest.h>

#include "tests/unit/server/live/milliseconds.h"

namespace needlelab {
namespace {

using Answer = Door::Answer;

Door::Settings doorSettings() {
  Door::Settings s;
  s.max_connections = 20;
  s.max_strangers = 10;
  s.charges_at_once = 6;
  s.refill = std::chrono::milliseconds(100);
  s.max_addresses = 50;
  return s;
}

TEST(Door, whoLogsInCostsItsAddressNothing) {
  Door door(doorSettings());
  for (std::uint64_t id = 0; id < 1000; ++id) {
    ASSERT_EQ(door.arrive(id, "10.0.0.1", 0).answer, Answer::kWelcome) << id;
    door.loggedIn(id, 0);
    if (id >= 15) door.left(id - 15);
  }
  EXPECT_EQ(door.strangers(), 0u);
  EXPECT_EQ(door.connections(), 15u);
}

TEST(Door, whoNeverLogsInUsesUpTheRoomOfItsOwnAddress) {
  Door door(doorSettings());
  std::uint64_t id = 0;
  // open or closed again: six at once, then one each 100 ms
  for (int i = 0; i < 6; ++i) {
    ASSERT_EQ(door.arrive(id, "10.0.0.1", 0).answer, Answer::kWelcome);
    door.left(id++);
  }
  EXPECT_EQ(door.arrive(id++, "10.0.0.1", 0).answer, Answer::kTooMany);
  EXPECT_EQ(door.arrive(id++, "10.0.0.1", 99 * kMs).answer, Answer::kTooMany);
  EXPECT_EQ(door.arrive(id++, "10.0.0.1", 100 * kMs).answer, Answer::kWelcome);
  EXPECT_EQ(door.arrive(id++, "10.0.0.1", 100 * kMs).answer, Answer::kTooMany);
  EXPECT_EQ(door.arrive(id++, "10.0.0.2", 100 * kMs).answer, Answer::kWelcome) << "others are not concerned";
}

TEST(Door, whenAllPlacesAreTakenTheGreediestAddressGivesWayWithItsOldest) {
  Door door(doorSettings());
  for (std::uint64_t id = 1; id <= 6; ++id) (void)door.arrive(id, "10.0.0.1", 0);
  for (std::uint64_t id = 7; id <= 10; ++id) (void)door.arrive(id, "10.0.0.2", 0);
  EXPECT_EQ(door.strangers(), 10u);
  const auto newcomer = door.arrive(11, "10.0.0.3", 0);
  EXPECT_EQ(newcomer.answer, Answer::kWelcome);
  EXPECT_EQ(newcomer.gives_way, std::optional<std::uint64_t>(1));
  EXPECT_EQ(door.strangers(), 10u);
  // however many addresses flood, a newcomer gets in
  for (std::uint64_t id = 12; id < 1000; ++id) {
    const auto arrival = door.arrive(id, "10.1." + std::to_string(id / 100) + "." + std::to_string(id), 0);
    ASSERT_EQ(arrival.answer, Answer::kWelcome);
    ASSERT_TRUE(arrival.gives_way.has_value());
  }
  EXPECT_EQ(door.strangers(), 10u);
}

TEST(Door, whoIsLoggedInNeverGivesWay) {
  auto s = doorSettings();
  s.max_strangers = 20;
  s.charges_at_once = 100;
  Door door(s);
  for (std::uint64_t id = 0; id < 19; ++id) {
    (void)door.arrive(id, "10.0.0.1", 0);
    door.loggedIn(id, 0);
  }
  EXPECT_EQ(door.arrive(100, "10.0.0.2", 0).answer, Answer::kWelcome);
  EXPECT_EQ(door.arrive(101, "10.0.0.2", 0).gives_way, std::optional<std::uint64_t>(100));
  door.loggedIn(101, 0);
  EXPECT_EQ(door.connections(), 20u);
  EXPECT_EQ(door.arrive(102, "10.0.0.3", 0).answer, Answer::kFull);
  door.left(3);
  EXPECT_EQ(door.arrive(103, "10.0.0.3", 0).answer, Answer::kWelcome);
}

TEST(Door, endsAreCountedOnceAndUnknownOnesNotAtAll) {
  Door door(doorSettings());
  (void)door.arrive(1, "10.0.0.1", 0);
  door.left(1);
  door.left(1);
  door.left(77);
  door.loggedIn(77, 0);
  EXPECT_EQ(door.connections(), 0u);
}

TEST(Door, memoryIsBoundedWhateverTheAddresses) {
  Door door(doorSettings());
  for (std::uint64_t id = 0; id < 5000; ++id) {
    (void)door.arrive(id, "10." + std::to_string(id / 250) + ".0." + std::to_string(id % 250), 0);
    EXPECT_LE(door.addresses(), 61u);  // those with a connection are kept: at most max_strangers beside
  }
}

TEST(Door, anAddressIsAnIpv4AddressOrTheFirstHalfOfAnIpv6One) {
  EXPECT_EQ(Door::keyOf("10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(Door::keyOf("::ffff:10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(Door::keyOf("[2001:db8:1:2::1]"), Door::keyOf("2001:db8:1:2:ffff::9"));
  EXPECT_NE(Door::keyOf("2001:db8:1:2::1"), Door::keyOf("2001:db8:1:3::1"));
  EXPECT_EQ(Door::keyOf("unknown"), "unknown");
}

}  // namespace
}  // namespace needlelab
