#include "server/live/limits/admission.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>

#include "tests/unit/server/live/milliseconds.h"

namespace needlelab {
namespace {

using Answer = Admission::Answer;
using Account = Admission::Account;

const Account kInes{.name = "ines"};

Admission::Settings admissionSettings() {
  Admission::Settings s;
  s.max_connections = 20;
  s.max_strangers = 10;
  s.charges_at_once = 6;
  s.refill = std::chrono::milliseconds(100);
  return s;
}

TEST(Admission, whoLogsInCostsItsAddressNothing) {
  auto s = admissionSettings();
  s.stations_one_in = 0;
  Admission admission(s);
  for (std::uint64_t id = 0; id < 1000; ++id) {
    ASSERT_EQ(admission.arrive(id, "10.0.0.1", 0).answer, Answer::kWelcome) << id;
    admission.loggedIn(id, kInes, 0);
    if (id >= 15) admission.left(id - 15);
  }
  EXPECT_EQ(admission.strangers(), 0u);
  EXPECT_EQ(admission.connections(), 15u);
}

TEST(Admission, anUnauthenticatedPeerUsesItsAddressesShare) {
  Admission admission(admissionSettings());
  std::uint64_t id = 0;
  // Opened and closed again: six at once, then one per 100 ms.
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

TEST(Admission, atFullCapacityTheGreediestAddressLosesItsOldest) {
  Admission admission(admissionSettings());
  for (std::uint64_t id = 1; id <= 6; ++id) (void)admission.arrive(id, "10.0.0.1", 0);
  for (std::uint64_t id = 7; id <= 10; ++id) (void)admission.arrive(id, "10.0.0.2", 0);
  EXPECT_EQ(admission.strangers(), 10u);
  const auto newcomer = admission.arrive(11, "10.0.0.3", 0);
  EXPECT_EQ(newcomer.answer, Answer::kWelcome);
  EXPECT_EQ(newcomer.displaced, std::optional<std::uint64_t>(1));
  EXPECT_EQ(admission.strangers(), 10u);
  // a newcomer gets in, however many addresses flood
  for (std::uint64_t id = 12; id < 1000; ++id) {
    const auto arrival =
        admission.arrive(id, "10.1." + std::to_string(id / 100) + "." + std::to_string(id), 0);
    ASSERT_EQ(arrival.answer, Answer::kWelcome);
    ASSERT_TRUE(arrival.displaced.has_value());
  }
  EXPECT_EQ(admission.strangers(), 10u);
}

TEST(Admission, whoIsLoggedInNeverGivesWayToAStranger) {
  auto s = admissionSettings();
  s.max_strangers = 20;
  s.charges_at_once = 100;
  s.stations_one_in = 0;
  Admission admission(s);
  for (std::uint64_t id = 0; id < 19; ++id) {
    (void)admission.arrive(id, "10.0.0.1", 0);
    admission.loggedIn(id, kInes, 0);
  }
  EXPECT_EQ(admission.arrive(100, "10.0.0.2", 0).answer, Answer::kWelcome);
  for (std::uint64_t id = 101; id < 120; ++id)
    EXPECT_EQ(admission.arrive(id, "10.0.0." + std::to_string(id), 0).displaced,
              std::optional<std::uint64_t>(id - 1))
        << "one place is kept for those who come";
  EXPECT_EQ(admission.connections(), 20u);
  admission.left(3);
  EXPECT_FALSE(admission.arrive(120, "10.0.0.3", 0).displaced.has_value());
}

/// A port with 16 places, one for newcomers and four for stations; people connect and log in.
class Port {
 public:
  explicit Port(Admission::Settings settings = {.max_connections = 16}) : admission(settings) {}

  /// The new connection's id; `gave_way` is then the one that was closed for it.
  std::uint64_t logIn(const Account& account) {
    const std::uint64_t id = ++last_id_;
    EXPECT_EQ(admission.arrive(id, "10.0.0.1", 0).answer, Answer::kWelcome);
    const auto arrival = admission.loggedIn(id, account, 0);
    refused = arrival.answer == Answer::kFull;
    gave_way = arrival.displaced;
    if (gave_way) account_of_.erase(*gave_way);
    if (refused)
      admission.left(id);
    else
      account_of_[id] = account;
    return id;
  }
  void logIn(const Account& account, int times) {
    for (int n = 0; n < times; ++n) logIn(account);
  }
  [[nodiscard]] std::ptrdiff_t connectionsOf(const Account& account) const {
    return std::count_if(account_of_.begin(), account_of_.end(),
                         [&](const auto& entry) { return entry.second == account; });
  }
  [[nodiscard]] const std::map<std::uint64_t, Account>& accounts() const { return account_of_; }

  Admission admission;
  std::optional<std::uint64_t> gave_way;
  bool refused = false;

 private:
  std::uint64_t last_id_ = 0;
  std::map<std::uint64_t, Account> account_of_;  // of those logged in, by connection
};

const Account kMara{.name = "mara"}, kAda{.name = "ada"};

Account stationOf(int number) {
  return {.name = "bench-" + std::to_string(number), .station = true};
}

TEST(Admission, atFullCapacityTheLargestAccountLosesItsLeastRecentlyUsed) {
  Port port;
  port.logIn(kInes, 7);  // 1 to 7
  port.logIn(kMara, 4);  // 8 to 11: all places for people
  port.admission.used(1);
  port.logIn(kAda);
  EXPECT_EQ(port.gave_way, std::optional<std::uint64_t>(2));
  // logging in again counts as use
  (void)port.admission.loggedIn(3, kInes, 0);
  port.logIn(kAda);
  EXPECT_EQ(port.gave_way, std::optional<std::uint64_t>(4));
  EXPECT_EQ(port.admission.connections(), 11u);
}

TEST(Admission, aGreedyAccountIsReducedToItsFairShare) {
  Port port;
  port.logIn(kInes, 40);
  EXPECT_EQ(port.connectionsOf(kInes), 11) << "its own gave way";
  for (const Account& account : {kMara, kAda, kInes, kMara, kAda}) {
    for (int n = 0; n < 11; ++n) {
      std::map<Account, std::ptrdiff_t> before;
      for (const auto& [id, whose] : port.accounts()) ++before[whose];
      port.logIn(account);
      EXPECT_FALSE(port.refused);
      ASSERT_TRUE(port.gave_way.has_value());
      for (const auto& [whose, count] : before) {
        if (whose == account || port.connectionsOf(whose) == count) continue;
        EXPECT_GE(count, before[account] + 2) << whose.name << " gives way to " << account.name;
      }
    }
  }
  // 11 places of three accounts
  for (const Account& account : {kInes, kMara, kAda}) {
    EXPECT_GE(port.connectionsOf(account), 3) << account.name;
    EXPECT_LE(port.connectionsOf(account), 4) << account.name;
  }
}

TEST(Admission, whoHasOneConnectionKeepsIt) {
  Port port;
  for (int n = 0; n < 11; ++n) port.logIn({.name = "person " + std::to_string(n)});
  port.logIn(kInes);
  EXPECT_TRUE(port.refused);
  EXPECT_FALSE(port.gave_way.has_value());
  port.logIn({.name = "person 4"});
  EXPECT_EQ(port.gave_way, std::optional<std::uint64_t>(5)) << "its own";
}

TEST(Admission, stationsHavePlacesThatPeopleCannotTake) {
  Port port;
  port.logIn(kInes, 20);
  for (int n = 1; n <= 4; ++n) {
    port.logIn(stationOf(n));
    EXPECT_FALSE(port.refused);
    EXPECT_FALSE(port.gave_way.has_value()) << n;
  }
  port.logIn(stationOf(5));
  ASSERT_TRUE(port.gave_way.has_value()) << "beyond its places a station is a newcomer as others";
  EXPECT_EQ(port.connectionsOf(kInes), 10);
  // a station never gives way to a person, even if it has the most
  port.logIn(kMara);
  EXPECT_EQ(port.connectionsOf(kMara), 1);
  for (int n = 1; n <= 5; ++n) EXPECT_EQ(port.connectionsOf(stationOf(n)), 1) << n;
  EXPECT_EQ(port.admission.connections(), 15u);
}

TEST(Admission, stationsMayTakeWhatPeopleDoNotUseAndKeepIt) {
  Port port;
  for (int n = 1; n <= 15; ++n) port.logIn(stationOf(n));
  EXPECT_FALSE(port.refused);
  port.logIn(kInes);
  EXPECT_TRUE(port.refused);
  for (int n = 1; n <= 15; ++n) EXPECT_EQ(port.connectionsOf(stationOf(n)), 1) << n;
}

TEST(Admission, anAccountAboveItsLimitReplacesItsOwnConnection) {
  Port port({.max_connections = 16, .connections_of_account = 3});
  port.logIn(kMara);
  port.logIn(kInes, 3);  // 2 to 4
  EXPECT_FALSE(port.gave_way.has_value());
  port.admission.used(2);
  port.logIn(kInes);
  EXPECT_EQ(port.gave_way, std::optional<std::uint64_t>(3));
  EXPECT_EQ(port.admission.connections(), 4u);
}

TEST(Admission, aConnectionMayChangeAccountsAndStationsAreNotPeople) {
  Port port({.max_connections = 16, .connections_of_account = 1});
  const std::uint64_t id = port.logIn(kInes);
  EXPECT_EQ(port.admission.loggedIn(id, kMara, 0).answer, Answer::kWelcome);
  port.logIn(kInes);
  EXPECT_FALSE(port.gave_way.has_value()) << "the first one is mara's now";
  port.logIn({.name = "ines", .station = true});
  EXPECT_FALSE(port.gave_way.has_value());
  port.logIn(kMara);
  EXPECT_EQ(port.gave_way, std::optional<std::uint64_t>(id));
}

TEST(Admission, whoFindsNoPlaceStaysAStranger) {
  Port port;
  for (int n = 0; n < 11; ++n) port.logIn({.name = "person " + std::to_string(n)});
  (void)port.admission.arrive(100, "10.0.0.2", 0);
  EXPECT_EQ(port.admission.loggedIn(100, kInes, 0).answer, Answer::kFull);
  EXPECT_EQ(port.admission.strangers(), 1u);
  port.admission.left(5);
  EXPECT_EQ(port.admission.loggedIn(100, kInes, 0).answer, Answer::kWelcome);
  EXPECT_EQ(port.admission.strangers(), 0u);
}

TEST(Admission, endsAreCountedOnceAndUnknownOnesNotAtAll) {
  Admission admission(admissionSettings());
  (void)admission.arrive(1, "10.0.0.1", 0);
  admission.left(1);
  admission.left(1);
  admission.left(77);
  admission.loggedIn(77, kInes, 0);
  EXPECT_EQ(admission.connections(), 0u);
}

// Charges leak away: however many addresses come, memory holds only those of the last moments.
TEST(Admission, memoryIsBoundedForAnyNumberOfAddresses) {
  Admission admission;
  constexpr std::int64_t kEvery_ns = kMs / 10;  // 10,000 connections per second, each from another address
  for (std::uint64_t id = 0; id < 20'000; ++id) {
    const std::string host = "10." + std::to_string(id / 250 / 250) + "." + std::to_string(id / 250 % 250) +
                             "." + std::to_string(id % 250);
    (void)admission.arrive(id, host, static_cast<std::int64_t>(id) * kEvery_ns);
    ASSERT_LE(admission.addressesWithCharges(), 2 * 201u) << "each has its charge for 20 ms";
    ASSERT_LE(admission.strangers(), AdmissionLimits{}.max_strangers_of_unknown);
  }
}

TEST(Admission, anAddressAboveItsNumberGivesWayToItself) {
  auto s = admissionSettings();
  s.strangers_of_address = 3;
  Admission admission(s);
  for (std::uint64_t id = 1; id <= 3; ++id) (void)admission.arrive(id, "10.0.0.1", 0);
  (void)admission.arrive(4, "10.0.0.2", 0);
  for (std::uint64_t id = 5; id <= 7; ++id)
    EXPECT_EQ(admission.arrive(id, "10.0.0.1", 0).displaced, std::optional<std::uint64_t>(id - 4));
  EXPECT_EQ(admission.strangers(), 4u);
  // a log-in frees a place: only strangers count
  admission.loggedIn(7, kInes, 0);
  EXPECT_FALSE(admission.arrive(8, "10.0.0.1", 0).displaced.has_value());
}

TEST(Admission, anAddressThatHasLoggedInBeforeHasAReserve) {
  auto s = admissionSettings();
  s.max_strangers_of_unknown = 6;
  s.charges_at_once = 100;
  Admission admission(s);
  (void)admission.arrive(1, "10.0.0.1", 0);
  EXPECT_FALSE(admission.knows("10.0.0.1", 0));
  admission.loggedIn(1, kInes, 0);
  EXPECT_TRUE(admission.knows("10.0.0.1", 0));
  for (std::uint64_t id = 2; id <= 7; ++id)
    EXPECT_FALSE(admission.arrive(id, "10.0.1." + std::to_string(id), 0).displaced.has_value());
  EXPECT_TRUE(admission.arrive(8, "10.0.1.8", 0).displaced.has_value()) << "six of unknown addresses";
  for (std::uint64_t id = 9; id <= 12; ++id)
    EXPECT_FALSE(admission.arrive(id, "10.0.0.1", 0).displaced.has_value()) << "four places are kept for it";
  EXPECT_EQ(admission.strangers(), 10u);
  // the next connection, from anywhere, takes an unknown address's place, although the lab has the most
  for (std::uint64_t id = 13; id <= 40; ++id) {
    const auto arrival = admission.arrive(id, id % 2 == 0 ? "10.0.2.1" : "10.0.2." + std::to_string(id), 0);
    ASSERT_TRUE(arrival.displaced.has_value());
    EXPECT_FALSE(*arrival.displaced >= 9 && *arrival.displaced <= 12) << *arrival.displaced;
  }
  const auto more = admission.arrive(41, "10.0.0.1", 0);
  ASSERT_TRUE(more.displaced.has_value());
  EXPECT_GT(*more.displaced, 12u);
}

TEST(Admission, aKnownAddressHasMoreCharges) {
  auto s = admissionSettings();
  s.charges_at_once_of_known = 8;
  Admission admission(s);
  (void)admission.arrive(0, "10.0.0.1", 0);
  admission.loggedIn(0, kInes, 0);
  for (std::uint64_t id = 1; id <= 9; ++id) {
    EXPECT_EQ(admission.arrive(id, "10.0.0.1", 0).answer, id <= 8 ? Answer::kWelcome : Answer::kTooMany)
        << id;
    admission.left(id);
  }
}

TEST(Admission, knownAddressesExpireAndTheOldestGoWhenFull) {
  auto s = admissionSettings();
  s.max_known = 3;
  s.known_for = std::chrono::hours(1);
  Admission admission(s);
  const std::int64_t hour_ns = 3'600'000 * kMs;
  for (std::uint64_t id = 1; id <= 4; ++id) {
    (void)admission.arrive(id, "10.0.0." + std::to_string(id), static_cast<std::int64_t>(id));
    admission.loggedIn(id, kInes, static_cast<std::int64_t>(id));
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
  EXPECT_EQ(admission.arriveFromProxy(21).displaced, std::optional<std::uint64_t>(16));
  for (std::uint64_t id = 22; id <= 25; ++id) (void)admission.arriveFromProxy(id);
  EXPECT_EQ(admission.arriveFromProxy(26).answer, Answer::kFull);
  admission.left(3);
  EXPECT_EQ(admission.arriveFromProxy(27).answer, Answer::kWelcome);
  // its connections carry many people's requests
  for (int n = 0; n < 3; ++n) EXPECT_FALSE(admission.loggedIn(27, kInes, 0).displaced.has_value());
  EXPECT_EQ(admission.connections(), 20u);
}

TEST(Admission, anAddressIsAnIpv4AddressOrIpv6Prefix) {
  EXPECT_EQ(Admission::keyOf("10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(Admission::keyOf("::ffff:10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(Admission::keyOf("[2001:db8:1:2::1]"), Admission::keyOf("2001:db8:1:2:ffff::9"));
  EXPECT_NE(Admission::keyOf("2001:db8:1:2::1"), Admission::keyOf("2001:db8:1:3::1"));
  EXPECT_EQ(Admission::keyOf("unknown"), "unknown");
}

}  // namespace
}  // namespace needlelab
