// The threads that run a request, a close or a station's log-in, and the work it waits for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/post.hpp>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/net/link/connect.h"
#include "common/base/time/clock.h"
#include "db/service/requests/requests.h"
#include "server/live/login/account_login.h"
#include "server/live/port/request_effects.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/common/wire/loopback.h"
#include "tests/unit/db/service/test_service.h"
#include "tests/unit/server/live/bare_context.h"

namespace needlelab {
namespace {

/// A server's pools and store, without its ports.
struct RequestThreadsTest : testing::Test {
  Tokens& tokens() { return dynamic_cast<LoginsInMemory&>(*context.logins.state).tokens; }
  ~RequestThreadsTest() override {
    release();
    for (asio::thread_pool* pool : {&others, &workers, &closers, &views}) pool->join();
  }

  /// Executes a request as the server does for a peer; returns whether the reply came.
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

  /// The same; sets `outcome` at its end. `gone`: as for executeRequest.
  Task<> answer(
      Principal who, pb::Request request, std::shared_ptr<Outcome>* outcome,
      std::function<bool()> gone = [] { return false; }) {
    const auto shared = std::make_shared<const pb::Request>(std::move(request));
    *outcome = co_await executeRequest(context, who, shared, std::move(gone));
  }

  /// An administrator adds a station; `gone` as for executeRequest, called on the workers. Sets `outcome` at
  /// its end.
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

  /// A session of this many chunks with kSamplesEach samples each, closed and not scored.
  static constexpr std::uint64_t kSamplesEach = 1000;
  Uuid closedSession(std::uint64_t chunks) {
    pb::Request show;
    show.mutable_get_profile()->set_id("knee-adult");
    const Outcome profile = store->service().execute({"ada", pb::ADMINISTRATOR}, show);
    EXPECT_FALSE(profile.error);
    const Uuid id = makeUuidV7();
    EXPECT_TRUE(store->writer()
                    .run([&](Connection& c) -> Status {
                      RETURN_IF_ERROR(StationStore(c).add("station-1", StationKeyBytes{}, 1));
                      SessionStore sessions(c);
                      auto description = test::describe(id);
                      description.set_profile_json(profile.reply.profile().json());
                      if (const auto opened = sessions.open(description, 1); !opened) return opened.error();
                      for (std::uint64_t seq = 0; seq < chunks; ++seq)
                        if (const auto stored = sessions.append(id, seq, test::chunkOf(seq, kSamplesEach));
                            !stored)
                          return stored.error();
                      const auto closed = sessions.close(test::closeOf(id, chunks, kSamplesEach), 2);
                      return closed ? Status() : Status(closed.error());
                    })
                    .ok());
    return id;
  }

  /// Takes a place and keeps it in `have`.
  using Places = std::vector<std::pair<std::string, std::unique_ptr<TurnQueue::Place>>>;
  void takePlace(TurnQueue& places, const std::string& who, Places& have) {
    asio::co_spawn(loop.io, placed(places, who, have), rethrow);
    poll();
  }
  static Task<> placed(TurnQueue& places, std::string who, Places& have) {
    auto place = co_await places.take(who);
    have.emplace_back(who, std::move(place));
  }
  void poll() {
    loop.io.restart();
    loop.io.poll();
  }

  /// Posts to a pool one piece of this person's work that ends with release().
  void occupy(FairPool& pool, const std::string& person) {
    pool.post(turnNameOf({person, pb::INSTRUCTOR}), untilRelease());
  }
  /// Occupies all closers but one.
  void occupyClosers(const std::shared_future<void>& end) {
    for (std::size_t n = 1; n < kCloserThreads; ++n) asio::post(closers, [end] { end.wait(); });
  }
  /// Requests a close as the server does for a station; it waits for its turn. Each of its steps calls
  /// `work`.
  void close(const std::string& station, std::function<void()> work, int steps = 1, bool is_long = false) {
    asio::co_spawn(loop.io, closed(station, std::move(work), steps, is_long), asio::detached);
    loop.io.restart();
    loop.io.poll();
  }
  Task<> closed(std::string station, std::function<void()> work, int steps, bool is_long) {
    CloseWork close_it;
    close_it.step = [work = std::move(work), left = std::make_shared<int>(steps)] {
      work();
      return Result<std::optional<CloseOutcome>>(--*left > 0 ? std::nullopt : std::optional(CloseOutcome{}));
    };
    close_it.gone = [gone = stations_gone_] { return gone->load(); };
    close_it.is_long = [is_long] { return is_long; };
    const auto outcome = co_await closeQueued(context, station, std::move(close_it));
    ++(outcome.ok() ? closes_done : closes_dropped);
  }
  /// From now on the connections that requested closes have ended.
  void endConnectionsOfStations() { *stations_gone_ = true; }
  /// Handles a message to a station as the server does: the station is not online.
  Task<> sayInVain(pb::Request request, std::size_t& refused) {
    Outcome outcome;
    outcome.server_part = ServerPart::kDeliver;
    const Doer ines{"ines"};
    const auto refusal = co_await complete(context, request, ines, outcome);
    EXPECT_TRUE(refusal.has_value());
    ++refused;
  }
  /// Checks a station's key and records its name, or "refused".
  Task<> check(pb::Login login, std::string address, std::vector<std::string>& checked) {
    const auto shared = std::make_shared<const pb::Login>(std::move(login));
    const auto who = co_await checkStationKey(context, shared, address);
    checked.push_back(who.ok() ? who->name : "refused");
  }
  /// Logs a station in as its connection does: the key, then the open sessions. Records its name at the end.
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

  test::TempFolder folder;
  std::unique_ptr<Store> store = test::openStore(folder.path() / "data");
  asio::thread_pool others{1}, workers{kWorkerThreads}, closers{kCloserThreads}, views{kViewThreads};
  test::Loopback loop;
  test::BareServer server{
      loop.io, *store, {.workers = workers, .closers = closers, .views = views, .others = others}};
  ServerContext& context = server.context();
  int closes_done = 0, closes_dropped = 0;

 private:
  const std::shared_ptr<std::atomic<bool>> stations_gone_ = std::make_shared<std::atomic<bool>>(false);
  std::promise<void> go_;
  std::shared_future<void> held_ = go_.get_future().share();
  bool released_ = false;
};

TEST_F(RequestThreadsTest, aStationsResultsWaitForNoViewOfPeople) {
  pb::Request results;
  results.mutable_get_results()->set_course_id("first");
  ASSERT_EQ(threadsOf(results, pb::STATION), RequestThreads::kViews);
  for (const char* person : {"ines", "mara", "ada", "ines"}) occupy(*context.work.views_of_people, person);
  EXPECT_TRUE(answered({"bench", pb::STATION}, results));
}

TEST_F(RequestThreadsTest, aBusyPersonDelaysNoOtherPersonsView) {
  pb::Request results;
  results.mutable_get_results()->set_course_id("first");
  for (int n = 0; n < 8; ++n) occupy(*context.work.views_of_people, "ines");
  EXPECT_TRUE(answered({"mara", pb::CURRICULUM_MANAGER}, results));
}

TEST_F(RequestThreadsTest, whatWaitsForItsTurnIsNotDoneForWhoHasGone) {
  occupy(*context.work.workers_of_people, "ada");  // each person may occupy at most one of the two threads
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

TEST_F(RequestThreadsTest, startedWorkIsFinishedAfterItsAskerLeaves) {
  std::atomic<int> asked{0};
  std::shared_ptr<Outcome> outcome;
  // connected when the turn comes, and gone from then on
  asio::co_spawn(loop.io,
                 addStation(
                     "begun", [&asked] { return asked++ > 0; }, &outcome),
                 rethrow);
  ASSERT_TRUE(loop.runUntil([&] { return outcome != nullptr; }));
  EXPECT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(stations(), std::set<std::string>{"begun"});
}

TEST_F(RequestThreadsTest, aRequestReservesDiskRoomUntilStoredOrRefused) {
  constexpr std::uint64_t kSeen = 1u << 30;
  context.limits.disk_room.look({.disk_bytes = kSeen});
  pb::Request add;
  add.mutable_add_station()->set_name("bench");
  const std::uint64_t cost = 2 * (add.ByteSizeLong() + PeopleShares::kRequestBytes);  // to log and database
  occupy(*context.work.workers_of_people, "ada");  // each person may occupy at most one of the two threads
  std::shared_ptr<Outcome> first, second;
  asio::co_spawn(loop.io, answer({"ada", pb::ADMINISTRATOR}, add, &first), rethrow);
  asio::co_spawn(loop.io, answer({"ada", pb::ADMINISTRATOR}, add, &second), rethrow);
  loop.io.restart();
  loop.io.poll();
  EXPECT_EQ(context.limits.disk_room.leftBytes(), kSeen - 2 * cost) << "no one knows yet";
  release();
  ASSERT_TRUE(loop.runUntil([&] { return first && second; }));
  EXPECT_FALSE(first->error) << first->error->message;
  EXPECT_TRUE(second->error) << "there is such a station already";
  EXPECT_EQ(context.limits.disk_room.leftBytes(), kSeen - cost);
}

TEST_F(RequestThreadsTest, aStationAndAPersonOfOneNameAreTwo) {
  EXPECT_NE(turnNameOf({"bench", pb::STATION}), turnNameOf({"bench", pb::TRAINEE}));
  EXPECT_EQ(turnNameOf({"ada", pb::TRAINEE}), turnNameOf({"ada", pb::ADMINISTRATOR}));
}

TEST_F(RequestThreadsTest, manyStationsClosesDelayNoOnesRequests) {
  pb::Request list;
  list.mutable_list_sessions();
  ASSERT_EQ(threadsOf(list, pb::INSTRUCTOR), RequestThreads::kWorkers);
  for (const char* station : {"bench", "cabin", "den"})
    for (int n = 0; n < 3; ++n) close(station, untilRelease());
  // both workers are free: the second piece ends the first one's wait
  std::promise<void> second;
  context.work.workers_of_people->post(turnNameOf({"mara", pb::INSTRUCTOR}),
                                       [done = second.get_future().share()] { done.wait(); });
  EXPECT_TRUE(answered({"ines", pb::INSTRUCTOR}, list));
  second.set_value();
  EXPECT_EQ(closes_done, 0);
  release();
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 9; }));
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

TEST_F(RequestThreadsTest, stationsClosesTakeTurnsAndLongOnesYieldAfterEachStep) {
  // all threads but one are occupied to the end, so this one runs piece after piece
  std::promise<void> end;
  occupyClosers(end.get_future().share());
  occupy(*context.work.closes_by_station, "ada");
  std::vector<std::string> done;
  const auto note = [&done](const char* text) { return [&done, text] { done.emplace_back(text); }; };
  close("bench", note("bench's close"), 3);
  for (const char* text : {"cabin's close 1", "cabin's close 2"}) close("cabin", note(text));
  close("den", note("den's close"));
  release();
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 4; }));
  end.set_value();
  closers.join();
  ASSERT_EQ(done.size(), 6u);
  // a step returns once the network's thread knows that the previous one ended: its place among cabin's
  // varies
  EXPECT_THAT(std::vector(done.begin(), done.begin() + 3),
              testing::ElementsAre("bench's close", "cabin's close 1", "den's close"));
  EXPECT_EQ(std::count(done.begin(), done.end(), "bench's close"), 3);
}

TEST_F(RequestThreadsTest, aShortCloseWaitsForNoLongScores) {
  for (const char* station : {"bench", "cabin", "den", "bench"}) close(station, untilRelease(), 1, true);
  close(
      "elm", [] {}, 3);
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 1; }));
  release();
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 5; }));
}

// The finding: scores of 5 s for two stations made a third one wait until one of them was done.
TEST_F(RequestThreadsTest, theLongScoresOfThreeStationsTakeTurnsStepByStep) {
  std::promise<void> end;
  occupyClosers(end.get_future().share());
  occupy(*context.work.long_scores_by_station, "ada");
  std::vector<std::string> done;
  const auto note = [&done](const char* text) { return [&done, text] { done.emplace_back(text); }; };
  for (const char* station : {"bench", "cabin", "den"}) close(station, note(station), 10, true);
  release();
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 3; }));
  end.set_value();
  closers.join();
  ASSERT_EQ(done.size(), 30u);
  EXPECT_THAT(std::vector(done.begin(), done.begin() + 3), testing::ElementsAre("bench", "cabin", "den"));
}

TEST_F(RequestThreadsTest, aStationHasOneLongScoreAndLeavingDropsWaitingOnes) {
  Places have;
  for (int n = 0; n < 3; ++n) takePlace(context.work.long_scores, "bench", have);
  EXPECT_EQ(have.size(), 1u);
  for (std::size_t n = 1; n < kLongScoresAtOnce; ++n)
    takePlace(context.work.long_scores, "cabin " + std::to_string(n), have);
  ASSERT_EQ(have.size(), kLongScoresAtOnce);
  int steps = 0;
  close(
      "den", [&steps] { ++steps; }, 2, true);
  close(
      "elm", [] {}, 2, false);
  EXPECT_TRUE(loop.runUntil([&] { return closes_done == 1; })) << "a short one needs no place";
  EXPECT_EQ(context.work.long_scores.waiting(), 3u);
  endConnectionsOfStations();
  have.pop_back();
  EXPECT_TRUE(loop.runUntil([&] { return closes_dropped == 1; })) << "bench waits for itself";
  EXPECT_EQ(steps, 0);
  EXPECT_EQ(context.work.long_scores.waiting(), 2u);
  for (int n = 0; n < 3; ++n) {
    have.clear();
    poll();
  }
  EXPECT_EQ(context.work.long_scores.waiting(), 0u);
}

TEST_F(RequestThreadsTest, placesAreGivenToEachNameInTurn) {
  TurnQueue places(loop.io.get_executor(), {.at_once = 1});
  Places have;
  const auto names = [&have] {
    std::vector<std::string> all;
    for (const auto& [name, place] : have) all.push_back(name);
    return all;
  };
  for (const char* who : {"ines", "ines", "ines", "ivo"}) takePlace(places, who, have);
  EXPECT_EQ(places.waiting(), 3u);
  std::vector<std::string> order = names();
  for (int n = 0; n < 3; ++n) {
    have.clear();
    poll();
    ASSERT_EQ(have.size(), 1u);
    order.push_back(have.front().first);
  }
  EXPECT_THAT(order, testing::ElementsAre("ines", "ines", "ivo", "ines"));
  EXPECT_EQ(places.waiting(), 0u);
}

// The finding: two rescorings blocked the thread for imports and backups for 10 s.
TEST_F(RequestThreadsTest, aRescoringThatWaitsForItsPlaceHoldsNoThread) {
  pb::Request again, verify;
  const Uuid id = closedSession(kShortScoreSamples / kSamplesEach + 1);
  again.mutable_rescore_session()->set_session_id(test::bytesOfId(id));
  verify.mutable_verify_session()->set_session_id(test::bytesOfId(makeUuidV7()));
  ASSERT_EQ(threadsOf(again, pb::INSTRUCTOR), RequestThreads::kScores);
  ASSERT_EQ(threadsOf(verify, pb::INSTRUCTOR), RequestThreads::kSlow);
  Places have;
  takePlace(context.work.rescorings, turnNameOf({"ivo", pb::INSTRUCTOR}), have);
  ASSERT_EQ(have.size(), 1u);
  std::shared_ptr<Outcome> outcome;
  asio::co_spawn(loop.io, answer({"ines", pb::INSTRUCTOR}, again, &outcome), rethrow);
  EXPECT_TRUE(answered({"mara", pb::CURRICULUM_MANAGER}, verify));
  EXPECT_EQ(outcome, nullptr);
  have.clear();
  ASSERT_TRUE(loop.runUntil([&] { return outcome != nullptr; }));
  EXPECT_FALSE(outcome->error) << outcome->error->message;
  takePlace(context.work.rescorings, turnNameOf({"ivo", pb::INSTRUCTOR}), have);
  EXPECT_EQ(have.size(), 1u) << "it gave its place back";
}

// there is only one place, and its holder must not keep it while the same person's other work runs
TEST_F(RequestThreadsTest, aPlacedScoreWaitsForOnePieceOfItsOwnersWork) {
  constexpr int kPieces = 20;
  const Principal ines{"ines", pb::INSTRUCTOR};
  pb::Request again;
  again.mutable_rescore_session()->set_session_id(
      test::bytesOfId(closedSession(kShortScoreSamples / kSamplesEach + 1)));
  occupy(*context.work.slow_workers_of_people, "ada");
  std::shared_ptr<Outcome> outcome;
  asio::co_spawn(loop.io, answer(ines, again, &outcome), rethrow);
  poll();
  // each ends when the network's thread has done the work posted before
  std::atomic<int> pieces{0};
  for (int i = 0; i < kPieces; ++i)
    context.work.slow_workers_of_people->post(turnNameOf(ines), [this, &pieces] {
      std::promise<void> seen;
      asio::post(loop.io, [&seen] { seen.set_value(); });
      seen.get_future().wait();
      ++pieces;
    });
  release();
  ASSERT_TRUE(loop.runUntil([&] { return outcome != nullptr; }));
  EXPECT_LT(pieces, kPieces);
  EXPECT_FALSE(outcome->error);
  EXPECT_TRUE(loop.runUntil([&] { return pieces == kPieces; }));
}

TEST_F(RequestThreadsTest, aShortRescoringNeedsNoPlace) {
  pb::Request again;
  again.mutable_rescore_session()->set_session_id(test::bytesOfId(closedSession(2)));
  Places have;
  takePlace(context.work.rescorings, turnNameOf({"ivo", pb::INSTRUCTOR}), have);
  ASSERT_EQ(have.size(), 1u);
  EXPECT_TRUE(answered({"ines", pb::INSTRUCTOR}, again));
}

TEST_F(RequestThreadsTest, theClosesOfAConnectionThatHasEndedAreDropped) {
  std::promise<void> end;
  occupyClosers(end.get_future().share());
  occupy(*context.work.closes_by_station, "ada");
  int steps = 0;
  for (int n = 0; n < 8; ++n)
    close(
        "bench", [&steps] { ++steps; }, 1000);
  endConnectionsOfStations();
  release();
  EXPECT_TRUE(loop.runUntil([&] { return closes_dropped == 8; }));
  end.set_value();
  closers.join();
  EXPECT_EQ(steps, 0);
  EXPECT_EQ(closes_done, 0);
}

/// A station that receives nothing.
struct DeafStation : HubPeer {
  void sendControl(const pb::Envelope&) override {}
  void sendLive(Frame, bool) override {}
};

TEST_F(RequestThreadsTest, anErasedPersonLosesAccessBeforeTheErasureEnds) {
  for (const char* name : {"tom", "ina"})
    ASSERT_TRUE(store->writer()
                    .run([name](Connection& c) {
                      return PeopleStore(c).add({name, pb::INSTRUCTOR, "", false, 1});
                    })
                    .ok());
  for (const char* ref : {"@1", "@2"}) tokens().issue({{ref, pb::INSTRUCTOR}, steadyNowNs()}, steadyNowNs());
  pb::Request erase;
  erase.mutable_erase_person()->set_name("tom");
  erase.mutable_erase_person()->set_confirm("tom");
  DeafStation bench;
  context.hub.attachStation("bench-1", bench);
  const std::string session = test::bytesOfId(makeUuidV7());
  context.hub.onSession("bench-1", session, "@1");
  pb::StationStatus status;
  status.set_session_id(session);
  status.set_trainee("tom");
  ASSERT_FALSE(context.hub.onStatus("bench-1", status, 0));
  const auto shown = [this] {
    pb::Stations stations;
    stations.add_stations()->set_name("bench-1");
    context.hub.fillStations(stations);
    return stations.stations(0).status().trainee();
  };
  EXPECT_EQ(shown(), "tom");
  // between ada's first and next step comes the work that is held until the release
  std::promise<void> begin;
  context.work.slow_workers_of_people->post(turnNameOf({"ina", pb::INSTRUCTOR}),
                                            [begun = begin.get_future().share()] { begun.wait(); });
  std::shared_ptr<Outcome> outcome;
  asio::co_spawn(loop.io, answer({"ada", pb::ADMINISTRATOR}, erase, &outcome), rethrow);
  poll();
  occupy(*context.work.slow_workers_of_people, "mara");
  begin.set_value();
  EXPECT_TRUE(loop.runUntil([&] { return tokens().size() == 1; }));
  EXPECT_EQ(shown(), "");
  context.hub.detachStation("bench-1", bench);
  EXPECT_EQ(outcome, nullptr) << "its next step waits";
  release();
  ASSERT_TRUE(loop.runUntil([&] { return outcome != nullptr; }));
  EXPECT_FALSE(outcome->error);
}

TEST_F(RequestThreadsTest, scoringALongSessionYieldsBetweenSteps) {
  constexpr std::uint64_t kChunks = kScoredAtOnce / kSamplesEach;  // each costs more than its samples
  const Uuid id = closedSession(kChunks);
  pb::Request again;
  again.mutable_rescore_session()->set_session_id(test::bytesOfId(id));
  occupy(*context.work.slow_workers_of_people, "ada");
  std::shared_ptr<Outcome> outcome;
  asio::co_spawn(loop.io, answer({"ines", pb::INSTRUCTOR}, again, &outcome), rethrow);
  poll();
  // comes after ines and is done before she has read everything: her next step sees its effect
  context.work.slow_workers_of_people->post(turnNameOf({"mara", pb::CURRICULUM_MANAGER}), [this] {
    EXPECT_TRUE(store->writer()
                    .run([](Connection& c) {
                      return c.run("UPDATE chunks SET crc = crc + 1 WHERE seq = ?", kChunks - 1);
                    })
                    .ok());
  });
  release();
  ASSERT_TRUE(loop.runUntil([&] { return outcome != nullptr; }));
  ASSERT_TRUE(outcome->error);
  EXPECT_EQ(outcome->error->code, ErrorCode::kCorrupt) << outcome->error->message;
}

TEST_F(RequestThreadsTest, workersDoNotWaitToAuditUndeliveredMessages) {
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

TEST_F(RequestThreadsTest, aStationsNameClaimedElsewhereCostsItNoTurns) {
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
  EXPECT_EQ(poolForWriting(context, 16'385), context.work.workers_of_people.get());
  EXPECT_EQ(poolForWriting(context, 65'535), context.work.workers_of_people.get());
  EXPECT_EQ(poolForWriting(context, 65'536), context.work.views_of_people.get());
}

}  // namespace
}  // namespace needlelab
