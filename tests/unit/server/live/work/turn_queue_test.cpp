#include "server/live/work/turn_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/wire/asio.h"
#include "server/live/limits/admission.h"
#include "server/live/work/offload.h"

namespace needlelab {
namespace {

using Line = LoginQueue::Line;

/// The waiting log-ins, each with a text; a turn ends when the next one is requested.
class Door {
 public:
  explicit Door(LoginQueue::Settings settings = {}) : queue_(io_.get_executor(), settings) {}

  bool join(const std::string& text, Line line, const std::string& address) {
    auto place = queue_.join(line, address);
    if (!place) return false;
    entries_.push_back({text, std::move(place)});
    return true;
  }
  /// Returns whose turn it is, and ends that turn.
  std::string next() {
    const auto turn = std::find_if(entries_.begin(), entries_.end(),
                                   [](const Entry& entry) { return entry.place->hasTurn(); });
    if (turn == entries_.end()) return {};
    const std::string text = turn->text;
    entries_.erase(turn);
    return text;
  }
  /// Turns until `text` has had its own, at most `most`.
  int turnsUntil(const std::string& text, int most = 1000) {
    for (int turns = 1; turns <= most; ++turns)
      if (next() == text) return turns;
    return most + 1;
  }
  std::size_t isDisplaced() {
    return static_cast<std::size_t>(std::count_if(
        entries_.begin(), entries_.end(), [](const Entry& entry) { return entry.place->isDisplaced(); }));
  }
  LoginQueue& queue() { return queue_; }

 private:
  struct Entry {
    std::string text;
    std::unique_ptr<LoginQueue::Place> place;
  };
  asio::io_context io_{1};
  LoginQueue queue_;
  std::vector<Entry> entries_;
};

TEST(TurnQueue, oneAfterTheOtherInOrder) {
  Door door;
  for (const char* text : {"a", "b", "c"}) EXPECT_TRUE(door.join(text, Line::kStranger, "10.0.0.1"));
  EXPECT_EQ(door.queue().size(), 3u);
  for (const char* text : {"a", "b", "c", ""}) EXPECT_EQ(door.next(), text);
  EXPECT_EQ(door.queue().size(), 0u);
}

TEST(TurnQueue, aFloodingAddressWaitsBehindItself) {
  Door door;
  for (int i = 0; i < 40; ++i) EXPECT_TRUE(door.join("flood", Line::kStranger, "10.0.0.1"));
  EXPECT_TRUE(door.join("neighbour", Line::kStranger, "10.0.0.2"));
  EXPECT_LE(door.turnsUntil("neighbour"), 3);
}

// The finding: some 20 addresses hold all the strangers' places at the single argon2 thread.
TEST(TurnQueue, twentyAddressesKeepNoStrangerOut) {
  for (const bool same_owner : {true, false}) {
    Door door;
    const auto address = [&](int i) {
      return same_owner ? Admission::keyOf("2001:db8:1:" + std::to_string(i) + "::5")
                        : "10.0." + std::to_string(i) + ".1";
    };
    int joined = 0;
    for (int i = 0; i < 400; ++i) joined += door.join("flood", Line::kStranger, address(i % 20)) ? 1 : 0;
    EXPECT_EQ(door.queue().size(), 48u) << "their places";
    EXPECT_TRUE(door.join("teacher", Line::kStranger, "192.168.7.7"));
    EXPECT_EQ(door.queue().size(), 48u);
    EXPECT_EQ(door.isDisplaced(), static_cast<std::size_t>(joined) + 1 - 48) << "one of the flood gave way";
    // They return after each turn: each owner has at most one turn before the teacher's.
    int turns = 1;
    while (door.next() != "teacher" && turns < 100) {
      ++turns;
      (void)door.join("flood", Line::kStranger, address(turns % 20));
    }
    EXPECT_LE(turns, same_owner ? 3 : 22);
  }
}

TEST(TurnQueue, freshAddressesDoNotGoBeforeWhoHasWaitedLonger) {
  Door door;
  EXPECT_TRUE(door.join("first", Line::kStranger, "10.0.0.1"));
  EXPECT_TRUE(door.join("again", Line::kStranger, "10.0.0.1"));
  int turns = 1;
  for (int fresh = 0; door.next() != "again" && turns < 100; ++fresh, ++turns)
    (void)door.join("fresh", Line::kStranger, "10.1." + std::to_string(fresh) + ".1");
  EXPECT_LE(turns, 4);
}

TEST(TurnQueue, knownPeopleHaveEverySecondTurnAndStrangersEveryFourth) {
  Door door({.places = 300, .places_of_unknown = 200});
  for (int i = 0; i < 40; ++i) {
    EXPECT_TRUE(door.join("known", Line::kKnownPerson, "10.0.0.1"));
    EXPECT_TRUE(door.join("lab", Line::kKnownAddress, "10.0.0.1"));
    EXPECT_TRUE(door.join("stranger", Line::kStranger, "10.5.0.1"));
  }
  std::map<std::string, int> turns;
  for (int i = 0; i < 40; ++i) ++turns[door.next()];
  EXPECT_EQ(turns["known"], 20);
  EXPECT_EQ(turns["lab"], 10);
  EXPECT_EQ(turns["stranger"], 10);
}

TEST(TurnQueue, aFloodOfStrangersTakesNoPlaceOfKnownPeople) {
  Door door;
  for (int i = 0; i < 200; ++i) (void)door.join("flood", Line::kStranger, "10.0." + std::to_string(i) + ".1");
  EXPECT_EQ(door.queue().size(), 48u);
  for (int i = 0; i < 16; ++i)
    EXPECT_TRUE(door.join("known " + std::to_string(i), Line::kKnownPerson, "10.0.0.1"));
  EXPECT_TRUE(door.join("known 17", Line::kKnownPerson, "10.0.0.1")) << "instead of a stranger";
  EXPECT_EQ(door.queue().size(), 64u);
  EXPECT_TRUE(door.join("lab", Line::kKnownAddress, "10.0.0.9")) << "instead of a stranger";
  EXPECT_LE(door.turnsUntil("lab"), 4);
}

TEST(TurnQueue, whoHasNoBetterClaimIsRefused) {
  Door door({.places = 4, .places_of_unknown = 4});
  for (int i = 0; i < 4; ++i)
    EXPECT_TRUE(door.join("a", Line::kStranger, "10." + std::to_string(i) + ".0.1"));
  EXPECT_FALSE(door.join("b", Line::kStranger, "10.9.0.1")) << "each has one";
  EXPECT_EQ(door.isDisplaced(), 0u);
}

TEST(TurnQueue, anOwnerOfManyAddressesIsOne) {
  EXPECT_EQ(LoginQueue::ownerOf("10.1.2.3"), "10.1.2.3");
  EXPECT_EQ(LoginQueue::ownerOf(Admission::keyOf("2001:db8:1:2::5")),
            LoginQueue::ownerOf(Admission::keyOf("2001:db8:1:3::5")));
  EXPECT_NE(LoginQueue::ownerOf(Admission::keyOf("2001:db8:1:2::5")),
            LoginQueue::ownerOf(Admission::keyOf("2001:db8:2:2::5")));
  EXPECT_EQ(LoginQueue::ownerOf("somewhere"), "somewhere");
}

// The turn's number used to be incremented by hand: an exception in between stopped every log-in.
TEST(TurnQueue, anExceptionDuringATurnGivesItOn) {
  asio::io_context io{1};
  LoginQueue queue(io.get_executor(), {});
  std::vector<std::string> seen;
  const auto log_in = [&](const std::string name, bool throws) -> Task<> {
    const auto place = queue.join(Line::kStranger, "10.0.0.1");
    while (!place->hasTurn()) co_await place->changed();
    asio::steady_timer check(io, std::chrono::nanoseconds(1));
    co_await check.async_wait(kUseTuple);
    seen.push_back(name);
    if (throws) throw std::runtime_error("no memory");
  };
  int failed = 0;
  for (const auto& [name, throws] : {std::pair("anna", true), std::pair("bert", false)}) {
    asio::co_spawn(io, log_in(name, throws),
                   [&](const std::exception_ptr& error) { failed += error ? 1 : 0; });
  }
  io.run();
  EXPECT_EQ(seen, (std::vector<std::string>{"anna", "bert"}));
  EXPECT_EQ(failed, 1);
  EXPECT_EQ(queue.size(), 0u);
}

}  // namespace
}  // namespace needlelab
