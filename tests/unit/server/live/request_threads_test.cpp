// On which threads a request's work is done, and behind whose work it waits: executeRequest, poolForWriting.
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "db/service/requests.h"
#include "server/live/context.h"
#include "server/live/request_effects.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/common/wire/loopback.h"

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
    std::function<bool()> gone = [] { return false; };
    const auto outcome = co_await executeRequest(context, who, request, std::move(gone));
    EXPECT_NE(outcome, nullptr);
  }

  /// An administrator adds a station; `gone` as for executeRequest, on the workers. Sets `outcome` at its
  /// end.
  Task<> addStation(std::string name, std::function<bool()> gone, std::shared_ptr<Outcome>* outcome) {
    pb::Request add;
    add.mutable_add_station()->set_name(name);
    const Principal ada{"ada", pb::ADMINISTRATOR};
    const auto request = std::make_shared<const pb::Request>(add);
    *outcome = co_await executeRequest(context, ada, request, std::move(gone));
  }
  std::set<std::string> stations() {
    pb::Request list;
    list.mutable_list_stations();
    std::set<std::string> names;
    const Outcome outcome = store->service().execute({"ada", pb::ADMINISTRATOR}, list);
    for (const pb::StationInfo& station : outcome.reply.stations().stations()) names.insert(station.name());
    return names;
  }

  /// Gives a pool one piece of this person that ends with release().
  void occupy(FairPool& pool, const std::string& person) {
    pool.post(turnNameOf({person, pb::INSTRUCTOR}), [held = held_] { held.wait(); });
  }
  void release() {
    if (!released_) go_.set_value();
    released_ = true;
  }

  static std::unique_ptr<Store> openStore(const std::filesystem::path& folder) {
    auto store = Store::open(folder, {});
    if (!store) throw std::runtime_error(store.error().message);
    return std::move(*store);
  }

  test::TempFolder folder;
  std::unique_ptr<Store> store = openStore(folder.path() / "data");
  asio::thread_pool others{1}, workers{kWorkerThreads}, views{kViewThreads};
  test::Loopback loop;
  ServerContext context{.io = loop.io,
                        .store = *store,
                        .passwords = others,
                        .logins = others,
                        .parsers = others,
                        .workers = workers,
                        .views = views,
                        .slow_workers = others,
                        .retention_workers = others,
                        .bounds = {},
                        .hub = Hub(),
                        .guard = LoginGuard(),
                        .tokens = Tokens(),
                        .counters = {},
                        .handshakes = HandshakeTurns(HandshakeTurns::Settings{.at_once = 1}),
                        .connections = {}};

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

TEST_F(RequestThreadsTest, whatWaitsForItsTurnIsNotDoneForWhoHasGone) {
  occupy(*context.workers_of_people, "ada");  // who has one of the two threads at most
  std::atomic<bool> gone{false};
  std::shared_ptr<Outcome> of_gone, of_staying;
  asio::co_spawn(loop.io,
                 addStation(
                     "of who has gone", [&gone] { return gone.load(); }, &of_gone),
                 rethrow);
  asio::co_spawn(loop.io,
                 addStation(
                     "of who stays", [] { return false; }, &of_staying),
                 rethrow);
  loop.io.poll();
  gone = true;
  release();
  ASSERT_TRUE(loop.runUntil([&] { return of_gone && of_staying; }));
  ASSERT_TRUE(of_gone->error);
  EXPECT_EQ(of_gone->error->code, ErrorCode::kUnavailable);
  EXPECT_FALSE(of_staying->error) << of_staying->error->message;
  EXPECT_EQ(stations(), std::set<std::string>{"of who stays"});
}

TEST_F(RequestThreadsTest, whatHasBegunIsFinishedForWhoGoesMeanwhile) {
  std::atomic<int> asked{0};
  std::shared_ptr<Outcome> outcome;
  // there when the turn comes, and gone from then on
  asio::co_spawn(loop.io,
                 addStation(
                     "begun", [&asked] { return asked++ > 0; }, &outcome),
                 rethrow);
  ASSERT_TRUE(loop.runUntil([&] { return outcome != nullptr; }));
  EXPECT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(stations(), std::set<std::string>{"begun"});
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
