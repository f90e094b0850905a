#include "server/live/admission.h"

#include <gtest/gtest.h>

#include "tests/unit/server/live/milliseconds.h"

namespace needlelab {
namespace {

using Answer = Admission::Answer;

Admission::Settings admissionSettings() {
  Admission::Settings s;
  s.max_connections = 20;
  s.max_strangers = 10;
  s.charges_at_once = 6;
  s.refill = std::chrono::milliseconds(100);
  s.max_addresses = 50;
  return s;
}

TEST(Admission, whoLogsInCostsItsAddressNothing) {
  Admission admission(admissionSettings());
  for (std::uint64_t id = 0; id < 1000; ++id) {
    ASSERT_EQ(admission.arrive(id, "10.0.0.1", 0).answer, Answer::kWelcome) << id;
    admission.loggedIn(id, 0);
    if (id >= 15) admission.left(id - 15);
  }
  EXPECT_EQ(admission.strangers(), 0u);
  EXPECT_EQ(admission.connections(), 15u);
}

TEST(Admission, whoNeverLogsInUsesUpTheRoomOfItsOwnAddress) {
  Admission admission(admissionSettings());
  std::uint64_t id = 0;
  // Open or closed again: six at once, then one per 100 ms.
  for (int i = 0; i < 6; ++i) {
    ASSERT_EQ(admission.arrive(id, "10.0.0.1", 0).answer, Answer::kWelcome);
    admission.left(id++);
  }
  EXPECT_EQ(admission.arrive(id++, "10.0.0.1", 0).answer, Answer::kTooMany);
  EXPECT_EQ(admission.arrive(id++, "10.0.0.1", 99 * kMs).answer, Answer::kTooMany);
  EXPECT_EQ(admission.arrive(id++, "10.0.0.1", 100 * kMs).answer, Answer::kWelcome);
  EXPECT_EQ(admission.arrive(id++, "10.0.0.1", 100 * kMs).answer, Answer::kTooMany);
  EXPECT_EQ(admission.arrive(id++, "10.0.0.2", 100 * kMs).answer, Answer::kWelcome)
      << "others are not concerned";
}

TEST(Admission, whenAllPlacesAreTakenTheGreediestAddressGivesWayWithItsOldest) {
  Admission admission(admissionSettings());
  for (std::uint64_t id = 1; id <= 6; ++id) (void)admission.arrive(id, "10.0.0.1", 0);
  for (std::uint64_t id = 7; id <= 10; ++id) (void)admission.arrive(id, "10.0.0.2", 0);
  EXPECT_EQ(admission.strangers(), 10u);
  const auto newcomer = admission.arrive(11, "10.0.0.3", 0);
  EXPECT_EQ(newcomer.answer, Answer::kWelcome);
  EXPECT_EQ(newcomer.gives_way, std::optional<std::uint64_t>(1));
  EXPECT_EQ(admission.strangers(), 10u);
  // however many addresses flood, a newcomer gets in
  for (std::uint64_t id = 12; id < 1000; ++id) {
    const auto arrival =
        admission.arrive(id, "10.1." + std::to_string(id / 100) + "." + std::to_string(id), 0);
    ASSERT_EQ(arrival.answer, Answer::kWelcome);
    ASSERT_TRUE(arrival.gives_way.has_value());
  }
  EXPECT_EQ(admission.strangers(), 10u);
}

TEST(Admission, whoIsLoggedInNeverGivesWay) {
  auto s = admissionSettings();
  s.max_strangers = 20;
  s.charges_at_once = 100;
  Admission admission(s);
  for (std::uint64_t id = 0; id < 19; ++id) {
    (void)admission.arrive(id, "10.0.0.1", 0);
    admission.loggedIn(id, 0);
  }
  EXPECT_EQ(admission.arrive(100, "10.0.0.2", 0).answer, Answer::kWelcome);
  EXPECT_EQ(admission.arrive(101, "10.0.0.2", 0).gives_way, std::optional<std::uint64_t>(100));
  admission.loggedIn(101, 0);
  EXPECT_EQ(admission.connections(), 20u);
  EXPECT_EQ(admission.arrive(102, "10.0.0.3", 0).answer, Answer::kFull);
  admission.left(3);
  EXPECT_EQ(admission.arrive(103, "10.0.0.3", 0).answer, Answer::kWelcome);
}

TEST(Admission, endsAreCountedOnceAndUnknownOnesNotAtAll) {
  Admission admission(admissionSettings());
  (void)admission.arrive(1, "10.0.0.1", 0);
  admission.left(1);
  admission.left(1);
  admission.left(77);
  admission.loggedIn(77, 0);
  EXPECT_EQ(admission.connections(), 0u);
}

TEST(Admission, memoryIsBoundedWhateverTheAddresses) {
  Admission admission(admissionSettings());
  for (std::uint64_t id = 0; id < 5000; ++id) {
    (void)admission.arrive(id, "10." + std::to_string(id / 250) + ".0." + std::to_string(id % 250), 0);
    EXPECT_LE(admission.addresses(), 61u);  // connected addresses are kept, plus at most max_strangers
  }
}

TEST(Admission, anAddressAboveItsNumberGivesWayToItself) {
  auto s = admissionSettings();
  s.strangers_of_address = 3;
  Admission admission(s);
  for (std::uint64_t id = 1; id <= 3; ++id) (void)admission.arrive(id, "10.0.0.1", 0);
  (void)admission.arrive(4, "10.0.0.2", 0);
  for (std::uint64_t id = 5; id <= 7; ++id)
    EXPECT_EQ(admission.arrive(id, "10.0.0.1", 0).gives_way, std::optional<std::uint64_t>(id - 4));
  EXPECT_EQ(admission.strangers(), 4u);
  // a log-in makes room: only strangers are counted
  admission.loggedIn(7, 0);
  EXPECT_FALSE(admission.arrive(8, "10.0.0.1", 0).gives_way.has_value());
}

TEST(Admission, anAddressThatHasLoggedInBeforeHasAReserve) {
  auto s = admissionSettings();
  s.max_strangers_of_unknown = 6;
  s.charges_at_once = 100;
  Admission admission(s);
  (void)admission.arrive(1, "10.0.0.1", 0);
  EXPECT_FALSE(admission.knows("10.0.0.1", 0));
  admission.loggedIn(1, 0);
  EXPECT_TRUE(admission.knows("10.0.0.1", 0));
  for (std::uint64_t id = 2; id <= 7; ++id)
    EXPECT_FALSE(admission.arrive(id, "10.0.1." + std::to_string(id), 0).gives_way.has_value());
  EXPECT_TRUE(admission.arrive(8, "10.0.1.8", 0).gives_way.has_value()) << "six of unknown addresses";
  for (std::uint64_t id = 9; id <= 12; ++id)
    EXPECT_FALSE(admission.arrive(id, "10.0.0.1", 0).gives_way.has_value()) << "four places are kept for it";
  EXPECT_EQ(admission.strangers(), 10u);
  // who comes next, from wherever, takes the place of an unknown address, though the lab has the most
  for (std::uint64_t id = 13; id <= 40; ++id) {
    const auto arrival = admission.arrive(id, id % 2 == 0 ? "10.0.2.1" : "10.0.2." + std::to_string(id), 0);
    ASSERT_TRUE(arrival.gives_way.has_value());
    EXPECT_FALSE(*arrival.gives_way >= 9 && *arrival.gives_way <= 12) << *arrival.gives_way;
  }
  const auto more = admission.arrive(41, "10.0.0.1", 0);
  ASSERT_TRUE(more.gives_way.has_value());
  EXPECT_GT(*more.gives_way, 12u);
}

TEST(Admission, aKnownAddressHasMoreCharges) {
  auto s = admissionSettings();
  s.charges_at_once_of_known = 8;
  Admission admission(s);
  (void)admission.arrive(0, "10.0.0.1", 0);
  admission.loggedIn(0, 0);
  for (std::uint64_t id = 1; id <= 9; ++id) {
    EXPECT_EQ(admission.arrive(id, "10.0.0.1", 0).answer, id <= 8 ? Answer::kWelcome : Answer::kTooMany)
        << id;
    admission.left(id);
  }
}

TEST(Admission, aKnownAddressIsForgottenAfterItsTimeAndTheOldestWhenThereAreTooMany) {
  auto s = admissionSettings();
  s.max_known = 3;
  s.known_for = std::chrono::hours(1);
  Admission admission(s);
  const std::int64_t hour_ns = 3'600'000 * kMs;
  for (std::uint64_t id = 1; id <= 4; ++id) {
    (void)admission.arrive(id, "10.0.0." + std::to_string(id), static_cast<std::int64_t>(id));
    admission.loggedIn(id, static_cast<std::int64_t>(id));
    admission.left(id);
  }
  EXPECT_EQ(admission.knownAddresses(), 3u);
  EXPECT_FALSE(admission.knows("10.0.0.1", 4)) << "known for longest";
  EXPECT_TRUE(admission.knows("10.0.0.2", hour_ns + 2));
  EXPECT_FALSE(admission.knows("10.0.0.2", hour_ns + 3));
}

TEST(Admission, aProxyIsNoStrangerAndCostsNothing) {
  Admission admission(admissionSettings());
  for (std::uint64_t id = 1; id <= 15; ++id)
    EXPECT_EQ(admission.arriveFromProxy(id).answer, Answer::kWelcome);
  EXPECT_EQ(admission.strangers(), 0u);
  for (std::uint64_t id = 16; id <= 20; ++id) (void)admission.arrive(id, "10.0.0.1", 0);
  EXPECT_EQ(admission.arriveFromProxy(21).gives_way, std::optional<std::uint64_t>(16));
  for (std::uint64_t id = 22; id <= 25; ++id) (void)admission.arriveFromProxy(id);
  EXPECT_EQ(admission.arriveFromProxy(26).answer, Answer::kFull);
  admission.left(3);
  EXPECT_EQ(admission.arriveFromProxy(27).answer, Answer::kWelcome);
}

TEST(Admission, anAddressIsAnIpv4AddressOrTheFirstHalfOfAnIpv6One) {
  EXPECT_EQ(Admission::keyOf("10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(Admission::keyOf("::ffff:10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(Admission::keyOf("[2001:db8:1:2::1]"), Admission::keyOf("2001:db8:1:2:ffff::9"));
  EXPECT_NE(Admission::keyOf("2001:db8:1:2::1"), Admission::keyOf("2001:db8:1:3::1"));
  EXPECT_EQ(Admission::keyOf("unknown"), "unknown");
}

}  // namespace
}  // namespace needlelab
