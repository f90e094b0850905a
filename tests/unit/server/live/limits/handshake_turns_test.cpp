#include "server/live/limits/handshake_turns.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/listen.h"
#include "tests/unit/server/live/milliseconds.h"

namespace needlelab {
namespace {

using Ids = std::vector<std::uint64_t>;

HandshakeTurns::Settings turnSettings() {
  HandshakeTurns::Settings s;
  s.at_once = 2;
  s.places = 4;
  s.places_of_known = 3;
  s.places_of_address = 3;
  s.patience = std::chrono::milliseconds(100);
  return s;
}

/// Everyone who may begin now, each answered at once, as by an idle server.
Ids allAnswered(HandshakeTurns& turns, std::int64_t now_ns) {
  Ids begun;
  while (const auto id = turns.next(now_ns)) {
    turns.answered(*id, now_ns);
    begun.push_back(*id);
  }
  return begun;
}

TEST(HandshakeTurns, areOnlyHeldWhileTheServerComputes) {
  HandshakeTurns turns(turnSettings());
  for (std::uint64_t id = 1; id <= 4; ++id) turns.came(id, "a" + std::to_string(id), false);
  ASSERT_TRUE(turns.next(0).has_value());
  ASSERT_TRUE(turns.next(0).has_value());
  EXPECT_EQ(turns.turns(), 2u);
  EXPECT_FALSE(turns.next(0).has_value()) << "two at once";
  turns.answered(4, 0);  // from now on it is silent
  EXPECT_EQ(turns.turns(), 1u);
  EXPECT_EQ(turns.next(0), std::optional<std::uint64_t>(2));
  turns.left(3);  // failed during the computation
  EXPECT_EQ(turns.next(0), std::optional<std::uint64_t>(1));
}

TEST(HandshakeTurns, anAddressWaitsForItsOwnPlacesOnly) {
  HandshakeTurns turns(turnSettings());
  for (std::uint64_t id = 1; id <= 5; ++id) turns.came(id, "silent", false);
  EXPECT_EQ(allAnswered(turns, 0), (Ids{5, 4, 3}));
  turns.came(6, "good", false);
  EXPECT_EQ(allAnswered(turns, 1 * kMs), (Ids{6}));
  EXPECT_EQ(turns.nextAt(), std::optional<std::int64_t>(100 * kMs));
  EXPECT_EQ(allAnswered(turns, 99 * kMs), Ids{});
  EXPECT_EQ(allAnswered(turns, 100 * kMs), (Ids{2, 1})) << "their places ended with their patience";
  EXPECT_FALSE(turns.nextAt().has_value()) << "no one waits";
}

TEST(HandshakeTurns, aHandshakeThatEndsGivesItsPlaceToItsAddress) {
  HandshakeTurns turns(turnSettings());
  for (std::uint64_t id = 1; id <= 4; ++id) turns.came(id, "a", false);
  EXPECT_EQ(allAnswered(turns, 0), (Ids{4, 3, 2}));
  turns.left(3);
  EXPECT_EQ(allAnswered(turns, 0), (Ids{1}));
}

// The attack: any number of addresses, all silent, all returning again and again. However many hold a place,
// the next address without one begins at once.
TEST(HandshakeTurns, silentAddressesDelayNoOneElse) {
  for (const int attackers : {2, 20, 200}) {
    SCOPED_TRACE(attackers);
    HandshakeTurns turns(turnSettings());
    std::uint64_t id = 0;
    for (int round = 0; round < 10; ++round) {
      for (int address = 0; address < attackers; ++address)
        turns.came(++id, "silent" + std::to_string(address), false);
      (void)allAnswered(turns, round * kMs);
      const std::uint64_t good = ++id;
      turns.came(good, "good", false);
      EXPECT_EQ(turns.next(round * kMs), std::optional<std::uint64_t>(good)) << round;
      turns.answered(good, round * kMs);
      turns.left(good);
      EXPECT_LE(turns.places(false), 4u);
    }
  }
}

TEST(HandshakeTurns, aPlaceThatWasGivenAwayStillCountsForItsAddress) {
  // two addresses that take each other's only place: each begins three within its patience, whatever the
  // other does
  auto s = turnSettings();
  s.places = 1;
  HandshakeTurns turns(s);
  std::size_t begun = 0;
  for (std::uint64_t id = 1; id <= 100; ++id) {
    turns.came(id, id % 2 == 0 ? "a" : "b", false);
    begun += allAnswered(turns, 0).size();
  }
  EXPECT_EQ(begun, 6u);
  EXPECT_EQ(turns.waiting(), 94u);
}

TEST(HandshakeTurns, knownAddressesGoFirstAndHavePlacesOfTheirOwn) {
  HandshakeTurns turns(turnSettings());
  for (std::uint64_t id = 1; id <= 20; ++id) turns.came(id, "stranger" + std::to_string(id), false);
  EXPECT_EQ(allAnswered(turns, 0).size(), 20u);
  EXPECT_EQ(turns.places(false), 4u) << "all places of strangers";
  turns.came(21, "lab", true);
  turns.came(22, "stranger22", false);
  turns.came(23, "lab", true);
  EXPECT_EQ(turns.next(0), std::optional<std::uint64_t>(23));
  EXPECT_EQ(turns.next(0), std::optional<std::uint64_t>(21));
  EXPECT_EQ(turns.places(true), 2u);
  EXPECT_EQ(turns.places(false), 4u) << "no stranger's place was taken";
}

TEST(HandshakeTurns, memoryIsThatOfTheConnectionsThatAreHere) {
  HandshakeTurns turns(turnSettings());
  for (std::uint64_t id = 1; id <= 1000; ++id) {
    turns.came(id, "address" + std::to_string(id), false);
    (void)allAnswered(turns, 0);
    turns.left(id);
    turns.left(id);
  }
  EXPECT_EQ(turns.begun(), 0u);
  EXPECT_EQ(turns.places(false), 0u);
  EXPECT_EQ(turns.waiting(), 0u);
  EXPECT_EQ(turns.turns(), 0u);
  turns.left(7);
  turns.answered(7, 0);
  EXPECT_EQ(turns.turns(), 0u);
}

// The finding: one connection was accepted per turn of the network's thread, so 256 from a stranger kept
// everyone else in the kernel's queue, where addresses are not visible.
TEST(HandshakeTurns, aKnownAddressGoesFirstThoughStrangersCameBeforeIt) {
  constexpr std::size_t kStrangers = 40;
  asio::io_context io;
  auto acceptor = listenOn(io, *resolveListen("127.0.0.1:0"), "127.0.0.1:0");
  ASSERT_TRUE(acceptor.ok());
  std::vector<Tcp::socket> peers, accepted;
  for (std::size_t i = 0; i <= kStrangers; ++i) {
    peers.emplace_back(io, Tcp::v4());
    peers.back().bind({asio::ip::make_address(i < kStrangers ? "127.9.8.7" : "127.0.0.1"), 0});
    peers.back().connect(acceptor->local_endpoint());
  }
  HandshakeTurns turns(turnSettings());
  asio::co_spawn(io,
                 acceptLoop(*acceptor, "accept_failed",
                            [&](Tcp::socket socket) {
                              const std::string from = socket.remote_endpoint().address().to_string();
                              accepted.push_back(std::move(socket));
                              turns.came(accepted.size(), from, from == "127.0.0.1");
                            }),
                 rethrow);
  while (accepted.empty()) io.run_one_for(std::chrono::milliseconds(20));
  EXPECT_EQ(turns.next(0), std::optional<std::uint64_t>(kStrangers + 1));
  acceptor->close();
  io.run_for(std::chrono::milliseconds(20));
}

}  // namespace
}  // namespace needlelab
