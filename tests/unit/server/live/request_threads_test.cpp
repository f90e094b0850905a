// On which threads a request's work is done, and behind whose work it waits: executeRequest, poolForWriting.
#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <string>

#include "db/service/requests.h"
#include "server/live/request_effects.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/common/wire/loopback.h"
#include "tests/unit/db/service/test_service.h"
#include "tests/unit/server/live/bare_context.h"

namespace needlelab {
namespace {

/// A server's pools and store, without its ports.
struct RequestThreadsTest : testing::Test {
  ~RequestThreadsTest() override {
    release();
    for (asio::thread_pool* pool : {&others, &workers, &views}) pool->join();
  }

  /// Asks as the server does for a peer; returns whether the reply came.
  bool answered(const Principal& who, const pb::Request& request) {
    bool done = false;
    asio::co_spawn(loop.io, ask(who, std::make_shared<const pb::Request>(request)),
                   [&](const std::exception_ptr& fault) { done = fault == nullptr; });
    return loop.runUntil([&] { return done; });
  }
  Task<> ask(Principal who, std::shared_ptr<const pb::Request> request) {
    const auto outcome = co_await executeRequest(context, who, request);
    EXPECT_NE(outcome, nullptr);
  }

  /// Gives a pool one piece of this person that ends with release().
  void occupy(FairPool& pool, const std::string& person) {
    pool.post(turnNameOf({person, pb::INSTRUCTOR}), [held = held_] { held.wait(); });
  }
  void release() {
    if (!released_) go_.set_value();
    released_ = true;
  }

  test::TempFolder folder;
  std::unique_ptr<Store> store = test::openStore(folder.path() / "data");
  asio::thread_pool others{1}, workers{kWorkerThreads}, views{kViewThreads};
  test::Loopback loop;
  ServerContext context =
      test::bareContext(loop.io, *store, {.workers = workers, .views = views, .others = others});

 private:
  std::promise<void> go_;
  std::shared_future<void> held_ = go_.get_future().share();
  bool released_ = false;
};

TEST_F(RequestThreadsTest, aStationsResultsWaitForNoViewOfPeople) {
  pb::Request results;
  results.mutable_get_results()->set_course_id("first");
  ASSERT_EQ(threadsOf(results, pb::STATION), RequestThreads::kViews);
  for (const char* person : {"ines", "mara", "ada", "ines"}) occupy(*context.views_of_people, person);
  EXPECT_TRUE(answered({"bench", pb::STATION}, results));
}

TEST_F(RequestThreadsTest, aPersonWhoHasWorkOnTheViewsDelaysNoOtherPersonsView) {
  pb::Request results;
  results.mutable_get_results()->set_course_id("first");
  for (int n = 0; n < 8; ++n) occupy(*context.views_of_people, "ines");
  EXPECT_TRUE(answered({"mara", pb::CURRICULUM_MANAGER}, results));
}

TEST_F(RequestThreadsTest, aStationAndAPersonOfOneNameAreTwo) {
  EXPECT_NE(turnNameOf({"bench", pb::STATION}), turnNameOf({"bench", pb::TRAINEE}));
  EXPECT_EQ(turnNameOf({"ada", pb::TRAINEE}), turnNameOf({"ada", pb::ADMINISTRATOR}));
}

TEST_F(RequestThreadsTest, onlyALongReplyIsWrittenOnTheViews) {
  EXPECT_EQ(poolForWriting(context, 0), nullptr);
  EXPECT_EQ(poolForWriting(context, 16'384), nullptr);
  EXPECT_EQ(poolForWriting(context, 16'385), context.workers_of_people.get());
  EXPECT_EQ(poolForWriting(context, 65'535), context.workers_of_people.get());
  EXPECT_EQ(poolForWriting(context, 65'536), context.views_of_people.get());
}

}  // namespace
}  // namespace needlelab
