// On which threads the work of a request, a close or a station's log-in is done, and behind whose work it
// waits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/post.hpp>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "client/net/connect.h"
#include "db/service/requests.h"
#include "server/live/context.h"
#include "server/live/request_effects.h"
#include "server/live/station_login.h"
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
    const auto outcome = co_await executeRequest(context, who, request);
    EXPECT_NE(outcome, nullptr);
  }

  /// Gives a pool one piece of this person that ends with release().
  void occupy(FairPool& pool, const std::string& person) {
    pool.post(turnNameOf({person, pb::INSTRUCTOR}), untilRelease());
  }
  /// Asks for a close as the server does for a station; it waits for its turn now.
  void close(const std::string& station, std::function<void()> work) {
    asio::co_spawn(loop.io, closed(station, std::move(work)), asio::detached);
    loop.io.restart();
    loop.io.poll();
  }
  Task<> closed(std::string station, std::function<void()> work) {
    std::function<Result<CloseOutcome>()> close_it = [work = std::move(work)]() -> Result<CloseOutcome> {
      work();
      return CloseOutcome{};
    };
    const auto outcome = co_await closeInTurn(context, station, std::move(close_it));
    EXPECT_TRUE(outcome.ok());
    ++closes_done;
  }
  /// Goes on as the server does with a message that is to be said to a station: it is not online.
  Task<> sayInVain(pb::Request request, std::size_t& refused) {
    Outcome outcome;
    outcome.server_part = ServerPart::kDeliver;
    const auto refusal = co_await complete(context, request, "ines", outcome);
    EXPECT_TRUE(refusal.has_value());
    ++refused;
  }
  /// Checks a station's key and notes its name, or "refused".
  Task<> check(pb::Login login, std::string address, std::vector<std::string>& checked) {
    const auto shared = std::make_shared<const pb::Login>(std::move(login));
    const auto who = co_await checkStationKey(context, shared, address);
    checked.push_back(who.ok() ? who->name : "refused");
  }
  /// Logs a station in as its connection does: the key, then the open sessions. Notes its name at the end.
  Task<> logIn(pb::Login login, std::string address, std::vector<std::string>& in) {
    std::vector<std::string> checked;
    co_await check(std::move(login), std::move(address), checked);
    const auto open = co_await openSessionsOf(context, checked.front());
    in.push_back(open.ok() ? checked.front() : open.error().message);
  }
  std::function<void()> untilRelease() const {
    return [held = held_] { held.wait(); };
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
  int closes_done = 0;

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

TEST_F(RequestThreadsTest, aStationsClosesDoNotHoldUpItsNextLesson) {
  pb::Request lesson;
  lesson.mutable_get_lesson()->set_exercise_id("practice");
  ASSERT_EQ(threadsOf(lesson, pb::STATION), RequestThreads::kWorkers);
  for (int n = 0; n < 4; ++n) close("bench", untilRelease());
  EXPECT_TRUE(answered({"bench", pb::STATION}, lesson));
  EXPECT_EQ(closes_done, 0);
  release();
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 4; }));
}

TEST_F(RequestThreadsTest, aStationsClosesTakeTurnsWithEachOtherAndWithOthers) {
  // one thread is taken to the end, so that the other one does piece after piece
  std::promise<void> end;
  asio::post(workers, [ended = end.get_future().share()] { ended.wait(); });
  occupy(*context.workers_of_people, "ada");
  std::vector<std::string> done;
  const auto note = [&done](const char* text) { return [&done, text] { done.emplace_back(text); }; };
  for (const char* text : {"bench's close 1", "bench's close 2", "bench's close 3"})
    close("bench", note(text));
  close("cabin", note("cabin's close"));
  context.workers_of_people->post(turnNameOf({"ines", pb::INSTRUCTOR}), note("ines"));
  context.workers_of_people->post(turnNameOf({"bench", pb::STATION}), note("bench's lesson"));
  release();
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 4; }));
  end.set_value();
  workers.join();
  EXPECT_THAT(done, testing::ElementsAre("bench's close 1", "cabin's close", "ines", "bench's lesson",
                                         "bench's close 2", "bench's close 3"));
}

TEST_F(RequestThreadsTest, noWorkerWaitsForTheWriterWithALineOfWhatWasNotDelivered) {
  ASSERT_TRUE(store->writer()
                  .post(
                      [wait = untilRelease()](Connection&) -> Status {
                        wait();
                        return {};
                      },
                      {})
                  .ok());
  pb::Request stop, list;
  stop.mutable_stop_lesson()->set_station("bench");
  std::size_t refused = 0;
  for (std::size_t n = 0; n < kWorkerThreads; ++n)
    asio::co_spawn(loop.io, sayInVain(stop, refused), asio::detached);
  ASSERT_TRUE(loop.runUntil([&] { return refused == kWorkerThreads; }));
  list.mutable_list_users();
  ASSERT_EQ(threadsOf(list, pb::ADMINISTRATOR), RequestThreads::kWorkers);
  EXPECT_TRUE(answered({"ada", pb::ADMINISTRATOR}, list));
  release();
  ASSERT_TRUE(store->writer().run([](Connection&) { return Status(); }).ok());
  pb::Request audit;
  audit.mutable_list_audit()->set_action("not delivered");
  const Outcome lines = store->service().execute({"ada", pb::ADMINISTRATOR}, audit);
  EXPECT_EQ(lines.reply.audit().entries_size(), static_cast<int>(kWorkerThreads));
}

TEST_F(RequestThreadsTest, aStationThatLogsInAgainAndAgainWaitsBehindItself) {
  std::map<std::string, std::string> keys;
  for (const char* name : {"bench", "cabin"}) {
    pb::Request add;
    add.mutable_add_station()->set_name(name);
    keys[name] = store->service().execute({"root", pb::ADMINISTRATOR}, add).reply.station_key().key();
  }
  std::vector<std::string> in;
  asio::post(others, untilRelease());
  int asked = 0;
  for (const char* name : {"bench", "bench", "bench", "cabin"}) {
    asio::co_spawn(loop.io, logIn(stationLogin(name, keys[name]), "10.0.0.1", in), asio::detached);
    ++asked;
  }
  loop.io.restart();
  loop.io.poll();
  release();
  EXPECT_TRUE(loop.runUntil([&] { return in.size() == static_cast<std::size_t>(asked); }));
  EXPECT_THAT(in, testing::ElementsAre("bench", "cabin", "bench", "bench"));
}

TEST_F(RequestThreadsTest, whoClaimsAStationsNameElsewhereTakesNoneOfItsTurns) {
  pb::Request add;
  add.mutable_add_station()->set_name("bench");
  const std::string key =
      store->service().execute({"root", pb::ADMINISTRATOR}, add).reply.station_key().key();
  std::vector<std::string> in;
  asio::post(others, untilRelease());
  for (int n = 0; n < 3; ++n)
    asio::co_spawn(loop.io, check(stationLogin("bench", "wrong"), "10.0.0.2", in), asio::detached);
  asio::co_spawn(loop.io, check(stationLogin("bench", key), "10.0.0.1", in), asio::detached);
  loop.io.restart();
  loop.io.poll();
  release();
  EXPECT_TRUE(loop.runUntil([&] { return in.size() == 4; }));
  EXPECT_THAT(in, testing::ElementsAre("refused", "bench", "refused", "refused"));
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
