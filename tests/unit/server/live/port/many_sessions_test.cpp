/// A station with more sessions than fit in one Welcome or in one connection's memory.
#include <gtest/gtest.h>

#include <set>

#include "client/net/uplink/uplink.h"
#include "db/sessions/session_store.h"
#include "tests/unit/client/net/spool/spool_samples.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

std::shared_ptr<SpoolSession> endedSession(Spool& spool, std::uint64_t chunks) {
  auto session = *spool.create(describeSession(makeUuidV7()));
  for (std::uint64_t seq = 0; seq < chunks; ++seq)
    EXPECT_TRUE(
        session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(seq * 10, 10)), 10).ok());
  EXPECT_TRUE(session->sync().ok());
  EXPECT_TRUE(session->end(false).ok());
  return session;
}

std::unique_ptr<Uplink> uplinkTo(RunningServer& server, const std::string& key) {
  UplinkConfig config;
  config.client = server.config(stationLogin("station-1", key));
  config.first_retry = 20ms;
  return std::make_unique<Uplink>(config, UplinkEvents{});
}

bool becomesTrue(const std::function<bool()>& done, milliseconds most = 60s) {
  const auto end = std::chrono::steady_clock::now() + most;
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(20ms);
  }
  return true;
}

/// Returns the number of sessions stored as complete.
std::int64_t completeOnes(RunningServer& server) {
  auto reader = server.server().store().readers().borrow();
  auto row = (*reader)->query("SELECT count(*) FROM sessions WHERE state = ?",
                              static_cast<int>(pb::SESSION_COMPLETE));
  EXPECT_TRUE(*row.step());
  return row.integer(0);
}

TEST(ManySessions, aLostEndIsResentEvenIfTheWelcomeIsFull) {
  RunningServer server;
  const std::string key = server.addStation("station-1");
  const TempFolder folder;
  auto spool = std::move(*Spool::open(folder.path()));
  const auto old = endedSession(*spool, 3);
  ASSERT_TRUE(old->setReceipt({3, 3, true, 7}).ok());
  // Restored from a backup with the session's chunks but not its end, plus 1,000 newer sessions that never
  // ended.
  Uuid id{};
  std::copy_n(old->description().session_id().begin(), id.size(), id.begin());
  ASSERT_TRUE(server.server()
                  .store()
                  .writer()
                  .run([&](Connection& writer) -> Status {
                    SessionStore store(writer);
                    if (auto opened = store.open(old->description(), 1); !opened.ok()) return opened.error();
                    for (std::uint64_t seq = 0; seq < 3; ++seq)
                      if (auto put = store.append(id, seq, *old->readChunk(seq)); !put.ok())
                        return put.error();
                    for (std::uint32_t i = 0; i < kMaxWelcomed; ++i)
                      if (auto opened = store.open(describeSession(makeUuidV7()), 1); !opened.ok())
                        return opened.error();
                    return {};
                  })
                  .ok());
  const auto uplink = uplinkTo(server, key);
  uplink->add(old, false);
  EXPECT_TRUE(becomesTrue([&] { return completeOnes(server) == 1; }));
  EXPECT_TRUE(becomesTrue([&] { return old->receipt().safe == 2; })) << "no backup has this end";
  EXPECT_TRUE(old->receipt().closed);
}

TEST(ManySessions, aStationOverItsRequestLimitIsServedInTime) {
  RunningServer server([](ServerOptions& options) {
    // status lines also arrive ten times per second
    options.bounds.small_messages_at_once = 20;
    options.bounds.small_messages_per_s = 25;
  });
  const std::string key = server.addStation("station-1");
  const TempFolder folder;
  auto spool = std::move(*Spool::open(folder.path()));
  constexpr std::int64_t kSessions = 30;
  const auto uplink = uplinkTo(server, key);
  // the server has lost them all
  for (std::int64_t i = 0; i < kSessions; ++i) {
    auto session = endedSession(*spool, 1);
    ASSERT_TRUE(session->setReceipt({1, 0, true, 7}).ok());
    uplink->add(std::move(session), false);
  }
  EXPECT_TRUE(becomesTrue([&] { return completeOnes(server) == kSessions; })) << completeOnes(server);
  EXPECT_EQ(uplink->state().connections, 1u) << "it was not thrown out";
}

TEST(ManySessions, aTooFrequentRequestIsRefusedByName) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.small_messages_at_once = 5;
    options.bounds.small_messages_per_s = 0.01;
  });
  auto client = std::move(*server.connect(stationLogin("s", server.addStation("s"))));
  std::vector<FakeSession> sessions(10, FakeSession("s"));
  for (FakeSession& session : sessions) {
    session = FakeSession("s");
    ASSERT_TRUE(client.send(session.open()).ok());
  }
  const pb::Refusal refusal = waitForRefusal(client);
  EXPECT_EQ(refusal.reason(), pb::Refusal::RATE_LIMITED);
  EXPECT_TRUE(std::any_of(sessions.begin(), sessions.end(),
                          [&](const FakeSession& session) { return session.id() == refusal.session_id(); }));
}

TEST(ManySessions, anAcknowledgementThatIsDueIsNotForgottenForAnotherSession) {
  RunningServer server([](ServerOptions& options) { options.bounds.known_sessions = 1; });
  auto client = std::move(*server.connect(stationLogin("s", server.addStation("s"))));
  const FakeSession older("s"), newer("s");
  for (const FakeSession* session : {&older, &newer}) ASSERT_TRUE(client.send(session->open()).ok());
  for (std::uint64_t seq = 0; seq < 20; ++seq) {
    // committed together
    ASSERT_TRUE(client.send(older.chunk(seq)).ok());
    ASSERT_TRUE(client.send(newer.chunk(seq)).ok());
    std::set<std::string> acknowledged;
    while (acknowledged.size() < 2 && !testing::Test::HasFailure()) {
      const auto ack = waitFor(client, [&](const pb::Envelope& e) {
                         return e.has_ack() && e.ack().committed_seqs() == seq + 1;
                       }).ack();
      acknowledged.insert(ack.session_id());
    }
    ASSERT_FALSE(testing::Test::HasFailure()) << seq;
  }
}

}  // namespace
}  // namespace needlelab::test
