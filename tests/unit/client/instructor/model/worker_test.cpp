#include "client/instructor/model/worker.h"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

namespace needlelab {
namespace {

bool pollUntil(Worker& worker, const std::function<bool()>& so) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!so()) {
    if (std::chrono::steady_clock::now() > end) return false;
    worker.poll();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

TEST(Worker, jobsRunInOrderAndTheirResultsComeInThePoll) {
  Worker worker;
  const auto here = std::this_thread::get_id();
  std::vector<int> done;
  for (int i = 0; i < 5; ++i) {
    worker.start("counting", [&, i](const auto&) -> Worker::Finish {
      EXPECT_NE(std::this_thread::get_id(), here);
      return [&, i] {
        EXPECT_EQ(std::this_thread::get_id(), here);
        done.push_back(i);
      };
    });
  }
  EXPECT_TRUE(worker.busy());
  ASSERT_TRUE(pollUntil(worker, [&] { return done.size() == 5; }));
  EXPECT_EQ(done, (std::vector<int>{0, 1, 2, 3, 4}));
  EXPECT_TRUE(pollUntil(worker, [&] { return !worker.busy(); }));
}

TEST(Worker, isBusyUntilItsResultWasTaken) {
  Worker worker;
  std::atomic<bool> ran{false};
  worker.start("one", [&](const auto&) -> Worker::Finish {
    ran = true;
    return [] {};
  });
  while (!ran) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_TRUE(worker.busy());
  EXPECT_TRUE(pollUntil(worker, [&] { return !worker.busy(); }));
}

TEST(Worker, itsEndStopsTheJobAndForgetsTheOthers) {
  std::atomic<bool> began{false}, second{false};
  {
    Worker worker;
    worker.start("for ever", [&](const auto& stopped) -> Worker::Finish {
      began = true;
      while (!stopped()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return {};
    });
    worker.start("never", [&](const auto&) -> Worker::Finish {
      second = true;
      return {};
    });
    while (!began) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_FALSE(second);
}

}  // namespace
}  // namespace needlelab
