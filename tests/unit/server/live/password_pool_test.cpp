#include "server/live/password_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/thread_pool.hpp>
#include <future>
#include <string>
#include <vector>

namespace needlelab {
namespace {

using testing::ElementsAre;
using HashLine = PasswordQueue::Line;

/// Hashes that note whose they were, instead of taking 0.1 s.
class FakeHashes {
 public:
  void ask(HashLine line, const std::string& who, std::size_t count = 1) {
    for (std::size_t n = 0; n < count; ++n) queue_.put(line, who, [this, who] { done_ = who; });
  }
  /// As the server does: false, when that is too many.
  bool mayAsk(HashLine line, const std::string& who) {
    if (!queue_.hasRoom(line, who)) return false;
    ask(line, who);
    return true;
  }
  std::string next() {
    done_.clear();
    if (const auto work = queue_.take()) work();
    return done_;
  }
  /// Turns until one of `who` is done, at most `most`.
  int turnsUntil(const std::string& who, int most = 10'000) {
    for (int turns = 1; turns <= most; ++turns)
      if (next() == who) return turns;
    return most + 1;
  }
  PasswordQueue& queue() { return queue_; }

 private:
  PasswordQueue queue_;
  std::string done_;
};

// The finding: 96 new codes of one trainee, and nobody could log in.
TEST(PasswordQueue, aLogInWaitsForOneOtherPieceAtMostWhoeverAsks) {
  for (const std::size_t people : {1u, 12u, 500u}) {
    FakeHashes thread;
    for (std::size_t i = 0; i < people; ++i) {
      for (int n = 0; n < 96; ++n) {
        (void)thread.mayAsk(HashLine::kPerson, "tom" + std::to_string(i));
        (void)thread.mayAsk(HashLine::kStation, "bench-" + std::to_string(i));
      }
    }
    EXPECT_EQ(thread.queue().size(), people * 2 * PasswordQueue::kMostWaiting);
    for (int logins = 0; logins < 40; ++logins) {
      thread.ask(HashLine::kLogin, "ines");
      EXPECT_LE(thread.turnsUntil("ines"), 2) << people;
    }
  }
}

TEST(PasswordQueue, aTraineesCodeAtAStationWaitsForNoFloodOfPeople) {
  FakeHashes thread;
  for (int i = 0; i < 100; ++i) {
    thread.ask(HashLine::kPerson, "tom" + std::to_string(i), 8);
    thread.ask(HashLine::kLogin, "ines");
  }
  for (int n = 0; n < 40; ++n) {
    thread.ask(HashLine::kStation, "bench-1");
    EXPECT_LE(thread.turnsUntil("bench-1"), 4);
  }
}

TEST(PasswordQueue, stationsAndPeopleTakeTurnsAmongThemselves) {
  FakeHashes thread;
  thread.ask(HashLine::kStation, "stolen", 8);
  thread.ask(HashLine::kPerson, "tom", 8);
  thread.ask(HashLine::kStation, "bench-1");
  thread.ask(HashLine::kPerson, "tina");
  std::vector<std::string> order;
  for (int n = 0; n < 6; ++n) order.push_back(thread.next());
  EXPECT_THAT(order, ElementsAre("stolen", "tom", "bench-1", "tina", "stolen", "tom"));
}

TEST(PasswordQueue, logInsHaveEverySecondTurnAndKeepNobodyOut) {
  FakeHashes thread;
  thread.ask(HashLine::kLogin, "log-in", 100);
  thread.ask(HashLine::kStation, "bench-1", 8);
  thread.ask(HashLine::kPerson, "tom", 8);
  std::vector<std::string> order;
  for (int n = 0; n < 8; ++n) order.push_back(thread.next());
  EXPECT_THAT(order, ElementsAre("log-in", "bench-1", "log-in", "tom", "log-in", "bench-1", "log-in", "tom"));
}

TEST(PasswordQueue, nobodyHasMoreThanEightWaiting) {
  FakeHashes thread;
  for (std::size_t n = 0; n < PasswordQueue::kMostWaiting; ++n)
    EXPECT_TRUE(thread.mayAsk(HashLine::kPerson, "tom")) << n;
  EXPECT_FALSE(thread.mayAsk(HashLine::kPerson, "tom"));
  EXPECT_TRUE(thread.mayAsk(HashLine::kPerson, "tina")) << "others have places of their own";
  EXPECT_TRUE(thread.mayAsk(HashLine::kStation, "tom")) << "a station of that name, too";
  EXPECT_EQ(thread.turnsUntil("tina"), 3);
  EXPECT_TRUE(thread.mayAsk(HashLine::kPerson, "tom")) << "one of his is done";
  EXPECT_FALSE(thread.mayAsk(HashLine::kPerson, "tom"));
}

TEST(PasswordQueue, nothingIsTakenFromAnEmptyOne) {
  PasswordQueue queue;
  EXPECT_FALSE(queue.take());
}

TEST(PasswordPool, runsEverythingOneAtATimeInTurns) {
  boost::asio::thread_pool threads(2);  // one would hide that two pieces run at once
  PasswordPool pool(threads);
  std::vector<std::string> done;  // without a lock: of one piece at a time
  std::promise<void> go;
  std::promise<void> begun;
  pool.post(HashLine::kPerson, "tom", [&] {
    begun.set_value();
    go.get_future().wait();
  });
  begun.get_future().wait();
  for (std::size_t n = 0; n < PasswordQueue::kMostWaiting; ++n) {
    EXPECT_TRUE(pool.hasRoom(HashLine::kPerson, "tom"));
    pool.post(HashLine::kPerson, "tom", [&] { done.push_back("tom"); });
  }
  EXPECT_FALSE(pool.hasRoom(HashLine::kPerson, "tom"));
  pool.post(HashLine::kLogin, "ines", [&] { done.push_back("ines"); });
  go.set_value();
  threads.join();
  ASSERT_EQ(done.size(), PasswordQueue::kMostWaiting + 1);
  EXPECT_EQ(done[0], "ines");
  EXPECT_TRUE(pool.hasRoom(HashLine::kPerson, "tom"));
}

}  // namespace
}  // namespace needlelab
