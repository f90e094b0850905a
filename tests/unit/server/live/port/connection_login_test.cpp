#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <thread>

#include "db/sessions/session_store.h"
#include "tests/support/run_form.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

TEST(ConnectionLogin, aStationWithItsKeyIsWelcome) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  auto client = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(client.ok()) << client.error().message;
  EXPECT_EQ(client->welcome().name(), "bench-1");
  EXPECT_EQ(client->welcome().role(), pb::STATION);
  EXPECT_EQ(client->welcome().open_sessions_size(), 0);
  EXPECT_NEAR(static_cast<double>(client->welcome().server_unix_ns()), static_cast<double>(wallNowNs()), 5e9);
}

TEST(ConnectionLogin, unknownWrongAndRevokedGiveTheSameReply) {
  RunningServer server;
  std::string key = server.addStation("bench-1");
  const std::string revoked_key = server.addStation("bench-2");
  pb::Request revoke;
  revoke.mutable_revoke_station()->set_name("bench-2");
  server.asAdmin(revoke);
  key[5] = static_cast<char>(key[5] ^ 1);
  std::vector<std::string> texts;
  for (const auto& login :
       {stationLogin("bench-1", key), stationLogin("nobody", key), stationLogin("bench-2", revoked_key)}) {
    const auto client = server.connect(login);
    ASSERT_FALSE(client.ok());
    EXPECT_EQ(client.error().code, ErrorCode::kDenied);
    texts.push_back(client.error().message);
  }
  EXPECT_EQ(texts[0], texts[1]);
  EXPECT_EQ(texts[0], texts[2]);
}

TEST(ConnectionLogin, anotherMajorVersionIsRefusedWithBothVersions) {
  RunningServer server;
  auto config = server.config(stationLogin("bench-1", server.addStation("bench-1")));
  config.version.set_major(kProtocolMajor + 6);
  config.version.set_minor(3);
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kVersion);
  EXPECT_THAT(client.error().message, HasSubstr(versionText(ourVersion())));
  EXPECT_THAT(client.error().message, HasSubstr(versionText(config.version)));
}

TEST(ConnectionLogin, anotherMinorVersionIsWelcome) {
  RunningServer server;
  auto config = server.config(stationLogin("bench-1", server.addStation("bench-1")));
  config.version.set_minor(kProtocolMinor + 9);
  EXPECT_TRUE(BlockingClient::connect(config).ok());
}

TEST(ConnectionLogin, aTokenReplacesThePasswordUntilTheAccountIsDisabled) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  auto first = server.connect(personLogin("anna", "correct horse battery"));
  ASSERT_TRUE(first.ok()) << first.error().message;
  EXPECT_EQ(first->welcome().role(), pb::INSTRUCTOR);
  pb::Login by_token;
  by_token.set_token(first->welcome().token());
  auto second = server.connect(by_token);
  ASSERT_TRUE(second.ok()) << second.error().message;
  EXPECT_EQ(second->welcome().name(), "anna");

  pb::Request disable;
  disable.mutable_disable_user()->set_name("anna");
  server.asAdmin(disable);
  EXPECT_EQ(server.connect(by_token).error().code, ErrorCode::kDenied);
  by_token.set_token(std::string(32, 'x'));
  EXPECT_EQ(server.connect(by_token).error().code, ErrorCode::kDenied);
}

TEST(ConnectionLogin, guessingIsSlowedDown) {
  RunningServer server([](ServerOptions& options) { options.guard.allowed_per_name = 2; });
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(server.connect(personLogin("anna", "guess")).error().code, ErrorCode::kDenied);
  const auto third = server.connect(personLogin("anna", "correct horse battery"));
  ASSERT_FALSE(third.ok());
  EXPECT_EQ(third.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(third.error().message, HasSubstr("RATE_LIMITED"));
}

TEST(ConnectionLogin, theOlderConnectionOfAStationIsClosedWithAReason) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  auto older = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(older.ok());
  auto newer = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(newer.ok());
  const auto refusal = waitForRefusal(*older);
  EXPECT_EQ(refusal.reason(), pb::Refusal::CONFLICT);
  EXPECT_TRUE(refusal.fatal());
  // the newer one works
  FakeSession session("bench-1");
  ASSERT_TRUE(newer->send(session.open()).ok());
  (void)waitFor(*newer, [](const pb::Envelope& e) { return e.has_session_opened(); });
}

TEST(ConnectionLogin, anUntrustedServerIsNotTalkedTo) {
  RunningServer server, other;
  auto config = server.config(stationLogin("bench-1", server.addStation("bench-1")));
  config.ca_file = other.server().caFile();
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kDenied);
}

/// Stations close hundreds of sessions, as after a long outage: a log-in at that time must not wait for all
/// the scores. NEEDLELAB_LONG: 500 sessions.
TEST(ConnectionLogin, doesNotWaitForTheScoresOfManySessions) {
  const bool all = test::longForm();
  // A connection has at most 8 closes in progress.
  const std::size_t stations = all ? 63 : 6, each = 8;
  constexpr std::uint64_t kChunks = 60;
  RunningServer server;
  pb::Request ask;
  ask.mutable_get_profile()->set_id("knee-adult");
  const std::string profile = server.asAdmin(ask).profile().json();
  std::vector<Bytes> chunks;
  for (std::uint64_t seq = 0; seq < kChunks; ++seq) chunks.push_back(FakeSession::bytes(seq));
  std::vector<BlockingClient> clients;
  std::vector<std::vector<FakeSession>> sessions(stations);
  for (std::size_t i = 0; i < stations; ++i) {
    const std::string name = "bench-" + std::to_string(i);
    auto client = server.connect(stationLogin(name, server.addStation(name)));
    ASSERT_TRUE(client.ok()) << client.error().message;
    clients.push_back(std::move(*client));
    for (std::size_t k = 0; k < each; ++k) sessions[i].emplace_back(name);
    ASSERT_TRUE(server.server()
                    .store()
                    .writer()
                    .run([&](Connection& c) -> Status {
                      for (const FakeSession& session : sessions[i]) {
                        SessionStore store(c);
                        const auto description = session.open(profile).open_session().description();
                        if (auto opened = store.open(description, 1); !opened.ok()) return opened.error();
                        Uuid id{};
                        std::copy(session.id().begin(), session.id().end(), id.begin());
                        for (std::uint64_t seq = 0; seq < kChunks; ++seq)
                          if (auto put = store.append(id, seq, chunks[seq]); !put.ok()) return put.error();
                      }
                      return {};
                    })
                    .ok());
  }
  for (std::size_t i = 0; i < stations; ++i) {
    for (const FakeSession& session : sessions[i]) {
      ASSERT_TRUE(clients[i].send(session.open(profile)).ok());
      (void)waitFor(clients[i], [](const pb::Envelope& e) { return e.has_session_opened(); });
    }
  }
  const std::string key = server.addStation("late");
  server.addUser("ina", pb::INSTRUCTOR, "a rather long password");
  std::vector<pb::Envelope> closes;
  for (const auto& of_station : sessions)
    for (const FakeSession& session : of_station) closes.push_back(session.close(kChunks));

  const auto person = server.connect(personLogin("ina", "a rather long password"));
  ASSERT_TRUE(person.ok()) << person.error().message;
  pb::Login token;
  token.set_token(person->welcome().token());

  for (std::size_t n = 0; n < closes.size(); ++n) ASSERT_TRUE(clients[n / each].send(closes[n]).ok());
  std::atomic<bool> all_scored = false;
  std::size_t logins = 0;  // begun after the last close was sent, and ended before the last score
  std::thread others([&] {
    while (!all_scored) {
      for (const auto& login : {stationLogin("late", key), token}) {
        const auto in = server.connect(login);
        EXPECT_TRUE(in.ok()) << in.error().message;
        if (!all_scored) ++logins;
      }
    }
  });
  std::size_t scored = 0;
  for (std::size_t n = 0; n < closes.size(); ++n) {
    const auto closed = waitFor(
        clients[n / each], [](const pb::Envelope& e) { return e.has_session_closed() || e.has_refusal(); },
        milliseconds(all ? 120'000 : 30'000));
    if (!closed.session_closed().score_json().empty()) ++scored;
  }
  all_scored = true;
  others.join();
  EXPECT_EQ(scored, closes.size());
  EXPECT_GT(logins, 0u) << "a log-in waited for all scores";
}

}  // namespace
}  // namespace needlelab
