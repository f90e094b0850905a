#include "server/live/fair_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/post.hpp>
#include <future>
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
