#include "server/live/work/fair_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <future>
#include <mutex>
#include <string>
#include <vector>

#include "server/live/work/server_work.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using Texts = std::vector<std::string>;

/// Pieces by their owner.
struct Asked {
  FairQueue<std::string> queue{};

  void ask(const std::string& who, std::size_t count = 1, std::size_t line = 0) {
    for (std::size_t n = 0; n < count; ++n) queue.put(who, who, line);
  }
  std::string next() {
    const auto taken = queue.take([](const std::string&) { return true; });
    return taken ? taken->item : std::string();
  }
  Texts all(std::size_t most = 10'000) {
    Texts order;
    while (order.size() < most && queue.size() > 0) order.push_back(next());
    return order;
  }
  /// Turns until one of `who`'s pieces is done.
  std::size_t turnsUntil(const std::string& who) {
    for (std::size_t turns = 1; queue.size() > 0; ++turns)
      if (next() == who) return turns;
    return SIZE_MAX;
  }
};

TEST(FairQueue, doesOnePieceOfEachPersonInTurn) {
  Asked asked;
  asked.ask("ines", 4);
  asked.ask("mara", 2);
  asked.ask("ada");
  EXPECT_EQ(asked.queue.size(), 7u);
  EXPECT_THAT(asked.all(), ElementsAre("ines", "mara", "ada", "ines", "mara", "ines", "ines"));
  EXPECT_EQ(asked.next(), "");
}

TEST(FairQueue, whoComesLateWaitsForOnePieceOfEachOther) {
  Asked asked;
  asked.ask("ines", 40);
  asked.ask("mara", 40);
  asked.all(5);
  asked.ask("ada");
  EXPECT_EQ(asked.turnsUntil("ada"), 3u);
}

TEST(FairQueue, whoAsksAgainAndAgainIsBehindTheOthersEachTime) {
  Asked asked;
  asked.ask("mara", 3);
  for (int n = 0; n < 3; ++n) {
    asked.ask("ines");
    EXPECT_THAT(asked.all(2), ElementsAre("mara", "ines")) << n;
  }
}

TEST(FairQueue, whoMayNotYetKeepsItsPlace) {
  Asked asked;
  asked.ask("ines", 2);
  asked.ask("mara", 2);
  const auto not_ines = [](const std::string& who) { return who != "ines"; };
  for (int n = 0; n < 2; ++n) EXPECT_EQ(asked.queue.take(not_ines)->who, "mara");
  EXPECT_FALSE(asked.queue.take(not_ines));
  asked.ask("mara");
  EXPECT_THAT(asked.all(), ElementsAre("ines", "mara", "ines"));
}

// The finding: one trainee set 96 new codes, and no one could log in. A station or person has at most
// ConnectionBounds::hashes_waiting waiting.
TEST(FairQueue, aLogInWaitsForAtMostOneOtherPiece) {
  for (const std::size_t people : {1u, 12u, 500u}) {
    Asked thread{FairQueue<std::string>(kPasswordLines)};
    for (std::size_t i = 0; i < people; ++i) {
      thread.ask("tom" + std::to_string(i), ConnectionBounds{}.hashes_waiting, kPersonLine);
      thread.ask("bench-" + std::to_string(i), ConnectionBounds{}.hashes_waiting, kStationLine);
    }
    for (int logins = 0; logins < 40; ++logins) {
      thread.ask("ines", 1, kLoginLine);
      EXPECT_LE(thread.turnsUntil("ines"), 2u) << people;
    }
  }
}

TEST(FairQueue, linesTakeTurnsAndAnEmptyOnePassesItsTurn) {
  struct Row {
    std::size_t logins, stations, people;
    Texts order;
  };
  const Row rows[] = {
      {100, 8, 8, {"log-in", "bench", "log-in", "tom", "log-in", "bench", "log-in", "tom"}},
      {0, 2, 2, {"bench", "tom", "bench", "tom"}},
      {3, 0, 2, {"log-in", "log-in", "tom", "log-in", "tom"}},
  };
  for (const Row& row : rows) {
    Asked thread{FairQueue<std::string>(kPasswordLines)};
    thread.ask("log-in", row.logins, kLoginLine);
    thread.ask("bench", row.stations, kStationLine);
    thread.ask("tom", row.people, kPersonLine);
    EXPECT_EQ(thread.all(row.order.size()), row.order);
  }
}

TEST(FairQueue, namesInALineTakeTurnsAndHaveTheirOwnLimit) {
  Asked thread{FairQueue<std::string>(kPasswordLines)};
  for (int i = 0; i < 100; ++i) thread.ask("tom" + std::to_string(i), 8, kPersonLine);
  thread.ask("stolen", 8, kStationLine);
  thread.ask("tom0", 1, kStationLine);
  EXPECT_EQ(thread.queue.waitingOf("tom0", kPersonLine), 8u);
  EXPECT_EQ(thread.queue.waitingOf("tom0", kStationLine), 1u) << "a station of that name";
  EXPECT_EQ(thread.queue.waitingOf("tina", kPersonLine), 0u);
  thread.ask("bench-1", 1, kStationLine);
  EXPECT_LE(thread.turnsUntil("bench-1"), 6u) << "behind two of the stations, and as many people";
}

TEST(FairPool, onePersonLeavesAThreadToTheOthers) {
  boost::asio::thread_pool threads(2);
  FairPool pool(threads, 2);
  std::mutex mutex;
  Texts done;
  const auto note = [&](const std::string& text) {
    const std::lock_guard lock(mutex);
    done.push_back(text);
  };
  std::promise<void> others_done;
  pool.post("ines", [&] {
    others_done.get_future().wait();
    note("ines, a long one");
  });
  pool.post("ines", [&] { note("ines"); });
  pool.post("mara", [&] { note("mara"); });
  pool.post("ada", [&] { note("ada"); });
  pool.post("mara", [&] {
    note("mara");
    others_done.set_value();
  });
  threads.join();
  // "ines" does not begin before the long one has ended, although a thread was idle at the end
  EXPECT_THAT(done, ElementsAre("mara", "ada", "mara", "ines, a long one", "ines"));
}

TEST(FairPool, onePersonHasAllThreadsButOneAtMost) {
  for (const std::size_t count : {1u, 2u, 4u}) {
    boost::asio::thread_pool threads(count);
    FairPool pool(threads, count);
    std::mutex mutex;
    std::size_t at_work = 0, most = 0, done = 0;
    for (int n = 0; n < 200; ++n) {
      pool.post("ines", [&] {
        {
          const std::lock_guard lock(mutex);
          most = std::max(most, ++at_work);
        }
        const std::lock_guard lock(mutex);
        --at_work;
        ++done;
      });
    }
    threads.join();
    EXPECT_EQ(done, 200u);
    EXPECT_LE(most, count == 1 ? 1u : count - 1) << count << " threads";
  }
}

TEST(FairPool, runsEverythingInTurnsAndLeavesRoomForOtherWork) {
  boost::asio::thread_pool threads(1);
  FairPool pool(threads, 1);
  Texts done;  // on the single thread, until it has ended
  std::promise<void> go;
  pool.post("ines", [&] { go.get_future().wait(); });
  for (int n = 0; n < 40; ++n) pool.post("ines", [&] { done.push_back("ines"); });
  pool.post("mara", [&] { done.push_back("mara"); });
  boost::asio::post(threads, [&] { done.push_back("server"); });
  go.set_value();
  threads.join();
  ASSERT_EQ(done.size(), 42u);
  // the server's own work waits for the work in the pool, not for the queue
  EXPECT_EQ(done[0], "server");
  EXPECT_TRUE(done[1] == "mara" || done[2] == "mara");
}

TEST(FairPool, ofOneThreadRunsOneAtATimeInItsLines) {
  boost::asio::thread_pool threads(2);  // with one thread two pieces could never run at once
  FairPool pool(threads, 1, kPasswordLines);
  Texts done;  // without a lock: one piece runs at a time
  std::promise<void> go, begun;
  const auto person = [&] { done.push_back("tom"); };
  pool.post(
      "tom",
      [&] {
        begun.set_value();
        go.get_future().wait();
      },
      kPersonLine);
  begun.get_future().wait();
  for (int n = 0; n < 8; ++n) pool.post("tom", person, kPersonLine);
  EXPECT_EQ(pool.waitingOf("tom", kPersonLine), 8u) << "without the one at work";
  pool.post(
      "ines", [&] { done.push_back("ines"); }, kLoginLine);
  go.set_value();
  threads.join();
  ASSERT_EQ(done.size(), 9u);
  EXPECT_EQ(done[0], "ines");
  EXPECT_EQ(pool.waitingOf("tom", kPersonLine), 0u);
}

}  // namespace
}  // namespace needlelab
