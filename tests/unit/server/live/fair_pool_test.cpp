#include "server/live/fair_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <future>
#include <mutex>
#include <string>
#include <vector>

namespace needlelab {
namespace {

using testing::ElementsAre;

/// Puts `count` pieces of a person that note their ends as "who 1", "who 2" …
void ask(FairQueue& queue, std::vector<std::string>& done, const std::string& who, int count) {
  for (int n = 1; n <= count; ++n)
    queue.put(who, [&done, text = who + " " + std::to_string(n)] { done.push_back(text); });
}

void runAll(FairQueue& queue) {
  while (const auto work = queue.take()) work();
}

TEST(FairQueue, doesOnePieceOfEachPersonInTurn) {
  FairQueue queue;
  std::vector<std::string> done;
  ask(queue, done, "ines", 4);
  ask(queue, done, "mara", 2);
  ask(queue, done, "ada", 1);
  EXPECT_EQ(queue.size(), 7u);
  runAll(queue);
  EXPECT_THAT(done, ElementsAre("ines 1", "mara 1", "ada 1", "ines 2", "mara 2", "ines 3", "ines 4"));
  EXPECT_EQ(queue.size(), 0u);
}

TEST(FairQueue, whoComesLateWaitsForOnePieceOfEachOther) {
  FairQueue queue;
  std::vector<std::string> done;
  ask(queue, done, "ines", 40);
  ask(queue, done, "mara", 40);
  for (int n = 0; n < 5; ++n) queue.take()();
  ask(queue, done, "ada", 1);
  runAll(queue);
  ASSERT_EQ(done.size(), 81u);
  EXPECT_EQ(done[7], "ada 1") << "after one of each";
}

TEST(FairQueue, whoAsksAgainAndAgainIsBehindTheOthersEachTime) {
  FairQueue queue;
  std::vector<std::string> done;
  ask(queue, done, "mara", 3);
  for (int n = 0; n < 3; ++n) {
    ask(queue, done, "ines", 1);
    queue.take()();
    queue.take()();
  }
  EXPECT_THAT(done, ElementsAre("mara 1", "ines 1", "mara 2", "ines 1", "mara 3", "ines 1"));
}

TEST(FairQueue, nothingIsTakenFromAnEmptyOne) {
  FairQueue queue;
  EXPECT_FALSE(queue.take());
}

TEST(FairQueue, whoMayNotYetKeepsItsPlace) {
  FairQueue queue;
  std::vector<std::string> done;
  ask(queue, done, "ines", 2);
  ask(queue, done, "mara", 2);
  const auto not_ines = [](const std::string& who) { return who != "ines"; };
  for (int n = 0; n < 2; ++n) {
    const FairQueue::Piece piece = queue.takeOf(not_ines);
    EXPECT_EQ(piece.who, "mara");
    piece.work();
  }
  EXPECT_FALSE(queue.takeOf(not_ines).work);
  EXPECT_EQ(queue.size(), 2u);
  ask(queue, done, "mara", 1);
  runAll(queue);
  EXPECT_THAT(done, ElementsAre("mara 1", "mara 2", "ines 1", "mara 1", "ines 2"));
}

TEST(FairPool, onePersonLeavesAThreadToTheOthers) {
  boost::asio::thread_pool threads(2);
  FairPool pool(threads, 2);
  std::mutex mutex;
  std::vector<std::string> done;
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
  // not "ines" before the long one has ended, though a thread had nothing else to do in the end
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
  std::vector<std::string> done;  // of the one thread, until it has ended
  std::promise<void> go;
  pool.post("ines", [&] { go.get_future().wait(); });
  for (int n = 0; n < 40; ++n) pool.post("ines", [&] { done.push_back("ines"); });
  pool.post("mara", [&] { done.push_back("mara"); });
  boost::asio::post(threads, [&] { done.push_back("server"); });
  go.set_value();
  threads.join();
  ASSERT_EQ(done.size(), 42u);
  // the server's own work waits for what is in the pool, not for the queue
  EXPECT_EQ(done[0], "server");
  EXPECT_TRUE(done[1] == "mara" || done[2] == "mara");
}

}  // namespace
}  // namespace needlelab
