#include "client/instructor/model/stored/worker.h"

#include <gtest/gtest.h>

#include <latch>
#include <vector>

#include "tests/support/patience.h"

namespace needlelab {
namespace {

// Blocks until all jobs so far have ended: the worker runs them one after another.
void waitForJobs(Worker& worker) {
  std::latch ended(1);
  worker.start("last", [&](const auto&) -> Worker::Finish {
    ended.count_down();
    return {};
  });
  ended.wait();
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
  waitForJobs(worker);
  EXPECT_TRUE(done.empty()) << "no one has polled";
  worker.poll();
  EXPECT_EQ(done, (std::vector<int>{0, 1, 2, 3, 4}));
}

TEST(Worker, showsItsTaskAndIsBusyUntilItsResultIsRead) {
  Worker worker;
  EXPECT_FALSE(worker.busy());
  std::latch runs(1), may_end(1);
  bool taken = false;
  worker.start("loading", [&](const auto&) -> Worker::Finish {
    runs.count_down();
    may_end.wait();
    return [&] { taken = true; };
  });
  worker.start("comparing", [](const auto&) -> Worker::Finish { return {}; });
  runs.wait();
  EXPECT_EQ(worker.doing(), "loading");
  may_end.count_down();
  waitForJobs(worker);
  // the last job's thread may not have left it yet
  EXPECT_TRUE(worker.doing() == "last" || worker.doing() == "finishing") << worker.doing();
  worker.poll();
  EXPECT_TRUE(taken);
}

TEST(Worker, itsEndStopsTheJobAndForgetsTheOthers) {
  std::latch began(1);
  bool second = false, told = false;
  {
    Worker worker;
    worker.start("for ever", [&](const auto& stopped) -> Worker::Finish {
      began.count_down();
      told = test::eventually(stopped);
      return {};
    });
    worker.start("never", [&](const auto&) -> Worker::Finish {
      second = true;
      return {};
    });
    began.wait();
  }
  EXPECT_TRUE(told);
  EXPECT_FALSE(second);
}

}  // namespace
}  // namespace needlelab
