// Refused log-ins and closed connections: accounts, floods from one peer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <thread>

#include "tests/support/patience.h"
#include "tests/support/store/password_cost.h"
#include "tests/unit/server/live/access_requests.h"
#include "tests/unit/server/live/log_lines.h"
#include "tests/unit/server/live/raw_peer.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

constexpr const char* kPassword = "correct horse battery";

/// Checks that the connection was closed for good with a message about the log-in.
void expectEnded(BlockingClient& client) {
  const auto refusal = waitForRefusal(client);
  EXPECT_EQ(refusal.reason(), pb::Refusal::LOGIN);
  EXPECT_TRUE(refusal.fatal());
}

/// Returns the audit log's entries of an action, newest first. Waits for one, because another thread writes
/// them.
std::vector<pb::AuditEntry> auditOf(RunningServer& server, const std::string& action) {
  std::vector<pb::AuditEntry> found;
  (void)eventually([&] {
    pb::Request request;
    request.mutable_list_audit();
    const pb::Reply reply = server.asAdmin(request);
    for (const auto& entry : reply.audit().entries())
      if (entry.action() == action) found.push_back(entry);
    return !found.empty();
  });
  return found;
}

TEST(Access, refusedLogInLinesAreBoundedAndCounted) {
  constexpr std::size_t kLines = 3;
  RunningServer server([](ServerOptions& options) {
    options.bounds.log_lines.a_minute = kLines;
    options.guard.allowed_per_name = 2;
    options.guard.first_wait = std::chrono::minutes(10);
  });
  const std::string key = server.addStation("bench-1");
  std::string wrong_key = key;
  wrong_key[5] = static_cast<char>(wrong_key[5] ^ 1);
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  std::size_t refused = 0, must_wait = 0;
  const std::string log = logOf(LogLevel::kWarning, [&] {
    for (int i = 0; i < 10; ++i) {
      const auto guess = server.connect(personLogin("anna", "a guess of hers"));
      ASSERT_FALSE(guess.ok());
      ++(guess.error().message.find("too many failed") == std::string::npos ? refused : must_wait);
    }
    for (int i = 0; i < 5; ++i, ++refused)
      EXPECT_FALSE(server.connect(stationLogin("bench-1", wrong_key)).ok());
    EXPECT_TRUE(server.connect(stationLogin("bench-1", key)).ok());
    server.stop();
  });
  ASSERT_GT(refused, kLines);
  ASSERT_GT(must_wait, kLines);
  EXPECT_EQ(countOf(log, "login_refused conn="), kLines) << log;
  EXPECT_EQ(countOf(log, "login_rate_limited conn="), kLines) << log;
  EXPECT_EQ(countOf(log, leftOut("strangers", "login_refused", refused - kLines)), 1u) << log;
  EXPECT_EQ(countOf(log, leftOut("strangers", "login_rate_limited", must_wait - kLines)), 1u) << log;
  EXPECT_EQ(server.counters().logins_refused, refused + must_wait) << "all are counted";
}

// The finding: each log-in with a station's key wrote four lines, with a program name of 900 bytes 0.9 MB per
// second.
TEST(Access, aKeysLogInLinesAreBoundedAndCounted) {
  constexpr std::size_t kLines = 3, kLogins = 10;
  RunningServer server([](ServerOptions& options) { options.bounds.log_lines.a_minute = kLines; });
  const std::string key = server.addStation("bench-1");
  const std::string log = logOf(LogLevel::kInfo, [&] {
    std::vector<BlockingClient> clients;
    for (std::size_t i = 0; i < kLogins; ++i) {
      ClientConfig config = server.config(stationLogin("bench-1", key));
      config.program = std::string(900, 'x');
      auto client = BlockingClient::connect(config);
      ASSERT_TRUE(client.ok()) << client.error().message;
      clients.push_back(std::move(*client));
    }
    server.stop();
  });
  for (const char* event : {"login_ok", "connection_closed"}) {
    EXPECT_EQ(countOf(log, std::string(event) + " conn="), kLines) << log;
    EXPECT_EQ(countOf(log, leftOut("\"station bench-1\"", event, kLogins - kLines)), 1u) << log;
  }
  EXPECT_EQ(countOf(log, "station_replaced conn="), kLines) << log;
  EXPECT_EQ(countOf(log, leftOut("\"station bench-1\"", "station_replaced", kLogins - 1 - kLines)), 1u)
      << log;
  EXPECT_EQ(countOf(log, "connection_opened conn="), kLines) << "before its log-in it is a stranger's";
  EXPECT_EQ(countOf(log, leftOut("strangers", "connection_opened", kLogins - kLines)), 1u) << log;
  EXPECT_EQ(countOf(log, std::string(100, 'x')), kLines) << "of the program's name 100 bytes";
}

// The finding: 60 meaningless messages hid the account's forbidden ones.
TEST(Access, messagesOfNoMeaningHideNoneThatTheRoleMayNot) {
  constexpr std::size_t kLines = 2, kOthers = 5;
  RunningServer server([](ServerOptions& options) { options.bounds.log_lines.a_minute = kLines; });
  server.addUser("ines", pb::INSTRUCTOR, kPassword);
  const std::string log = logOf(LogLevel::kWarning, [&] {
    auto ines = server.connect(personLogin("ines", kPassword));
    ASSERT_TRUE(ines.ok()) << ines.error().message;
    pb::Envelope unknown, foreign;
    unknown.mutable_unsubscribe()->set_subscription(99);
    foreign.mutable_station_status();
    for (std::size_t i = 0; i < kOthers; ++i) {
      ASSERT_TRUE(ines->send(unknown).ok());
      EXPECT_EQ(waitForRefusal(*ines).reason(), pb::Refusal::NOT_FOUND);
    }
    ASSERT_TRUE(ines->send(foreign).ok());
    EXPECT_EQ(waitForRefusal(*ines).reason(), pb::Refusal::ROLE);
    server.stop();
  });
  EXPECT_EQ(countOf(log, "message_refused conn="), kLines + 1) << log;
  EXPECT_EQ(countOf(log, "reason=ROLE"), 1u) << log;
  EXPECT_EQ(countOf(log, leftOut("\"person @1\"", "message_refused", kOthers - kLines)), 1u) << log;
}

TEST(Access, parallelGuessesShareTheSequentialLimit) {
  RunningServer server([](ServerOptions& options) {
    options.guard.first_wait = std::chrono::minutes(10);
    options.limits.handshake_timeout = std::chrono::minutes(10);
  });
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  server.addUser("bert", pb::INSTRUCTOR, kPassword);
  constexpr std::size_t kGuesses = 32;
  std::vector<std::unique_ptr<RawPeer>> peers;
  for (std::size_t i = 0; i < kGuesses; ++i) {
    peers.push_back(std::make_unique<RawPeer>(server));
    peers.back()->greet();
  }
  // The right one is among them, after more wrong ones than allowed.
  for (std::size_t i = 0; i < kGuesses; ++i) {
    pb::Envelope envelope;
    *envelope.mutable_login() = personLogin("anna", i == 31 ? kPassword : "guess " + std::to_string(i));
    peers[i]->send(envelope);
    if (i == 30) std::this_thread::sleep_for(milliseconds(50));
  }
  std::map<pb::Refusal::Reason, int> refused;
  for (auto& peer : peers) {
    const auto answer = peer->receive();
    ASSERT_TRUE(answer.has_value());
    EXPECT_TRUE(answer->has_refusal());
    ++refused[answer->refusal().reason()];
  }
  EXPECT_EQ(refused[pb::Refusal::LOGIN], 5) << "as many as one after the other";
  EXPECT_EQ(refused[pb::Refusal::RATE_LIMITED], 27);
  EXPECT_EQ(auditOf(server, "log-in locked").size(), 1u);
  // Other log-ins continue: turns are still given out.
  EXPECT_TRUE(server.connect(personLogin("bert", kPassword)).ok());
}

TEST(Access, theWelcomeAnnouncesTheKeepalivePeriod) {
  RunningServer server([](ServerOptions& options) { options.limits.keepalive = milliseconds(1250); });
  const std::string key = server.addStation("bench-1");
  const auto client = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(client.ok()) << client.error().message;
  EXPECT_EQ(client->welcome().keepalive_ms(), 1250u);
}

TEST(Access, rightPasswordsThatComeTogetherAllLogIn) {
  RunningServer server(
      [](ServerOptions& options) { options.limits.handshake_timeout = std::chrono::minutes(10); });
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  std::vector<std::unique_ptr<RawPeer>> peers;
  for (int i = 0; i < 8; ++i) {
    peers.push_back(std::make_unique<RawPeer>(server));
    peers.back()->greet();
  }
  pb::Envelope envelope;
  *envelope.mutable_login() = personLogin("anna", kPassword);
  for (auto& peer : peers) peer->send(envelope);
  for (auto& peer : peers) {
    const auto answer = peer->receive();
    ASSERT_TRUE(answer.has_value());
    EXPECT_TRUE(answer->has_welcome());
  }
}

TEST(Access, refusalsOfAPeerDoNotFillTheLog) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  std::string refusals;
  pb::Envelope refusal;
  refusal.mutable_refusal()->set_reason(pb::Refusal::INTERNAL);
  refusal.mutable_refusal()->set_text("no, thank you");
  for (int i = 0; i < 1000; ++i) refusals += RawPeer::framed(refusal);
  // Strangers: the first Refusal closes the connection, without a warning.
  const std::string of_strangers = logOf(LogLevel::kWarning, [&] {
    for (const bool greets : {false, true}) {
      RawPeer stranger(server);
      if (greets) stranger.greet();
      stranger.write(refusals);
      EXPECT_TRUE(stranger.readAll().empty());
      EXPECT_TRUE(stranger.closed());
    }
  });
  EXPECT_EQ(countOf(of_strangers, "no, thank you"), 0u) << of_strangers;
  // A logged-in peer may send Refusals and stays connected; the log has the first one and their number.
  const std::string of_station = logOf(LogLevel::kWarning, [&] {
    RawPeer station(server);
    ASSERT_TRUE(station.logIn(stationLogin("bench-1", key)).has_welcome());
    station.write(refusals);
    pb::Envelope ping;
    ping.mutable_ping()->set_id(7);
    station.send(ping);
    bool answered = false;
    while (const auto got = station.receive()) {
      if (got->has_pong() && got->pong().id() == 7) {
        answered = true;
        break;
      }
    }
    EXPECT_TRUE(answered);
    EXPECT_EQ(server.stop(), 0);
  });
  EXPECT_EQ(countOf(of_station, "no, thank you"), 1u) << of_station;
  EXPECT_THAT(of_station, HasSubstr("count=1000"));
}

TEST(Access, disablingAnAccountDisconnectsItAtOnceAndIsAudited) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto first = server.connect(personLogin("anna", kPassword));
  ASSERT_TRUE(first.ok()) << first.error().message;
  const std::string token = first->welcome().token();
  auto second = server.connect(byToken(token));
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(second.ok() && chief.ok());
  ASSERT_TRUE(chief->call(disable("anna")).ok());
  expectEnded(*first);
  expectEnded(*second);
  for (const std::string& each : {token, second->welcome().token()})
    EXPECT_EQ(server.connect(byToken(each)).error().code, ErrorCode::kDenied);
  const auto noted = auditOf(server, "access ended");
  ASSERT_EQ(noted.size(), 1u);
  EXPECT_EQ(noted[0].who(), "chief");
  EXPECT_EQ(noted[0].subject(), "anna");
  EXPECT_THAT(noted[0].detail(), HasSubstr("2 connections, 2 tokens"));
}

TEST(Access, anErasedPersonIsDisconnectedAndNotNamedInTheLog) {
  RunningServer server;
  server.addUser("anna", pb::TRAINEE, kPassword);
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto anna = server.connect(personLogin("anna", kPassword));
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(anna.ok() && chief.ok());
  pb::Request erase;
  erase.mutable_erase_person()->set_name("anna");
  erase.mutable_erase_person()->set_confirm("anna");
  const auto erased = chief->call(erase);
  ASSERT_TRUE(erased.ok()) << erased.error().message;
  expectEnded(*anna);
  const auto noted = auditOf(server, "access ended");
  ASSERT_EQ(noted.size(), 1u);
  EXPECT_EQ(noted[0].subject(), erased->erasure().pseudonym());
  pb::Request list;
  list.mutable_list_audit();
  const pb::Reply lines = server.asAdmin(list);
  for (const auto& line : lines.audit().entries())
    EXPECT_EQ(line.ShortDebugString().find("anna"), std::string::npos) << line.ShortDebugString();
}

TEST(Access, aRoleChangedByImportDisconnectsAndIsLogged) {
  RunningServer server;
  server.addUser("anna", pb::ADMINISTRATOR, kPassword);
  server.addUser("bert", pb::INSTRUCTOR, kPassword);
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto anna = server.connect(personLogin("anna", kPassword));
  auto bert = server.connect(personLogin("bert", kPassword));
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(anna.ok() && bert.ok() && chief.ok());
  pb::Request import;
  import.mutable_import_people()->set_csv("name,role\nanna,instructor\nbert,instructor\n");
  const auto done = chief->call(import);
  ASSERT_TRUE(done.ok()) << done.error().message;
  expectEnded(*anna);
  EXPECT_EQ(server.connect(byToken(anna->welcome().token())).error().code, ErrorCode::kDenied);
  pb::Request list;
  list.mutable_list_users();
  EXPECT_TRUE(bert->call(list).ok()) << "whose role is the same continues";
  const auto noted = auditOf(server, "user import");
  ASSERT_EQ(noted.size(), 2u);
  EXPECT_EQ(noted[1].subject(), "anna");
  EXPECT_THAT(noted[1].detail(), HasSubstr("role: administrator to instructor"));
  // By its own request: after the answer, the connection with the old role is closed, too.
  pb::Request own;
  own.mutable_change_user()->set_name("chief");
  own.mutable_change_user()->set_base_revision(1);
  own.mutable_change_user()->set_role(pb::INSTRUCTOR);
  server.addUser("deputy", pb::ADMINISTRATOR, kPassword);
  EXPECT_TRUE(chief->call(own).ok());
  expectEnded(*chief);
}

TEST(Access, aRequestThatChangesNothingDisconnectsNoOne) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto anna = server.connect(personLogin("anna", kPassword));
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(anna.ok() && chief.ok());
  pb::Request same;
  same.mutable_change_user()->set_name("anna");
  same.mutable_change_user()->set_base_revision(1);
  same.mutable_change_user()->set_role(pb::INSTRUCTOR);
  ASSERT_TRUE(chief->call(same).ok());
  same.mutable_change_user()->set_full_name("Anna A");
  ASSERT_TRUE(chief->call(same).ok()) << "another name is not another access";
  pb::Request list;
  list.mutable_list_users();
  EXPECT_TRUE(anna->call(list).ok());
  EXPECT_TRUE(server.connect(byToken(anna->welcome().token())).ok());
  // another change of the account ends them
  pb::Request demote;
  demote.mutable_change_user()->set_name("anna");
  demote.mutable_change_user()->set_base_revision(2);
  demote.mutable_change_user()->set_role(pb::TRAINEE);
  ASSERT_TRUE(chief->call(demote).ok());
  expectEnded(*anna);
}

TEST(Access, whoDisablesItselfIsOutAfterTheAnswer) {
  RunningServer server;
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  server.addUser("deputy", pb::ADMINISTRATOR, kPassword);
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(chief.ok());
  EXPECT_TRUE(chief->call(disable("chief")).ok());
  expectEnded(*chief);
}

TEST(Access, aNewPasswordEndsWhatTheOldOneOpened) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto mine = server.connect(personLogin("anna", kPassword));
  auto thief = server.connect(personLogin("anna", kPassword));
  ASSERT_TRUE(mine.ok() && thief.ok());
  // Her own change: the connection that made it stays open.
  pb::Request own = passwordOf("anna", "something else entirely");
  EXPECT_FALSE(mine->call(own).ok()) << "who only has her open connection does not know the old one";
  EXPECT_TRUE(server.connect(personLogin("anna", kPassword)).ok());
  own.mutable_set_password()->set_old_password(kPassword);
  ASSERT_TRUE(mine->call(own).ok());
  expectEnded(*thief);
  EXPECT_EQ(server.connect(byToken(thief->welcome().token())).error().code, ErrorCode::kDenied);
  EXPECT_EQ(server.connect(byToken(mine->welcome().token())).error().code, ErrorCode::kDenied);
  EXPECT_EQ(server.connect(personLogin("anna", kPassword)).error().code, ErrorCode::kDenied);
  pb::Request list;
  list.mutable_list_users();
  EXPECT_TRUE(mine->call(list).ok());
  // An administrator's change: all of her connections are closed.
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(chief.ok());
  ASSERT_TRUE(chief->call(passwordOf("anna", "and once more another")).ok());
  expectEnded(*mine);
}

TEST(Access, aRevokedStationIsPutOutAtOnceAndItIsNoted) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto station = server.connect(stationLogin("bench-1", key));
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(station.ok() && chief.ok());
  pb::Request revoke;
  revoke.mutable_revoke_station()->set_name("bench-1");
  ASSERT_TRUE(chief->call(revoke).ok());
  expectEnded(*station);
  EXPECT_EQ(auditOf(server, "access ended").size(), 1u);
}

TEST(Access, aChangeDuringThePasswordCheckIsDetected) {
  RunningServer server;
  server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  auto chief = server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(chief.ok());
  RawPeer peer(server);
  peer.greet();
  // The check reads the account first and then hashes; in between the account is disabled.
  PasswordChecks checks(PasswordChecks::Gate::kClosed);
  pb::Envelope login;
  *login.mutable_login() = personLogin("anna", kPassword);
  peer.send(login);
  ASSERT_TRUE(checks.waitForOne());
  ASSERT_TRUE(chief->call(disable("anna")).ok());
  checks.openGate();
  const auto all = peer.readAll();
  ASSERT_EQ(all.size(), 1u) << "no Welcome, not even for a moment";
  ASSERT_TRUE(all[0].has_refusal()) << all[0].ShortDebugString();
  EXPECT_EQ(all[0].refusal().reason(), pb::Refusal::LOGIN);
}

TEST(Access, aTokenExpiresButItsOpenConnectionStays) {
  // expires at once: Tokens' own tests use the clock
  RunningServer server([](ServerOptions& options) { options.token_lifetime = milliseconds(0); });
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  auto anna = server.connect(personLogin("anna", kPassword));
  ASSERT_TRUE(anna.ok());
  EXPECT_EQ(server.connect(byToken(anna->welcome().token())).error().code, ErrorCode::kDenied);
  pb::Request list;
  list.mutable_list_users();
  EXPECT_TRUE(anna->call(list).ok());
}

TEST(Access, aLogInOfStaffIsInTheAuditLog) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  ASSERT_TRUE(server.connect(personLogin("anna", kPassword)).ok());
  ASSERT_TRUE(server.connect(personLogin("anna", kPassword)).ok());
  const auto lines = auditOf(server, "log-in");
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].who(), "anna");
  EXPECT_EQ(lines[0].detail(), "instructor from 127.0.0.1");
}

TEST(Access, guessingElsewhereLocksNoOneOutOfTheLab) {
  RunningServer server([](ServerOptions& options) {
    options.guard.allowed_per_name = 2;
    options.guard.allowed_everywhere = 3;
    options.guard.allowed_per_address = 4;
  });
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  const std::string key = server.addStation("bench-1");
  ASSERT_TRUE(server.connect(personLogin("anna", kPassword)).ok());
  // From three other addresses, until each is refused without a password check.
  for (const std::string from : {"127.0.0.2", "127.0.0.3", "127.0.0.4"}) {
    bool limited = false;
    for (int i = 0; i < 6 && !limited; ++i) {
      const auto answer = RawPeer(server, from).logIn(personLogin("anna", "a guess"));
      ASSERT_TRUE(answer.has_refusal());
      limited = answer.refusal().reason() == pb::Refusal::RATE_LIMITED;
    }
    EXPECT_TRUE(limited) << from;
  }
  EXPECT_TRUE(RawPeer(server, "127.0.0.5").logIn(personLogin("anna", kPassword)).has_refusal())
      << "a new address waits, too";
  EXPECT_TRUE(server.connect(personLogin("anna", kPassword)).ok()) << "in the lab she continues";
  EXPECT_TRUE(RawPeer(server, "127.0.0.2").logIn(stationLogin("bench-1", key)).has_welcome())
      << "keys cannot be guessed: a right one is never kept out";
  EXPECT_FALSE(auditOf(server, "log-in locked").empty());
}

TEST(Access, aPersonHasSoManyConnections) {
  RunningServer server([](ServerOptions& options) { options.bounds.connections_of_person = 3; });
  server.addUser("anna", pb::INSTRUCTOR, kPassword);
  std::vector<BlockingClient> open;
  for (int i = 0; i < 3; ++i) {
    auto client = server.connect(personLogin("anna", kPassword));
    ASSERT_TRUE(client.ok()) << client.error().message;
    open.push_back(std::move(*client));
  }
  const auto fourth = server.connect(personLogin("anna", kPassword));
  ASSERT_FALSE(fourth.ok());
  EXPECT_THAT(fourth.error().message, HasSubstr("RATE_LIMITED"));
  open.pop_back();
  EXPECT_TRUE(server.connect(personLogin("anna", kPassword)).ok());
}

TEST(Access, whoHasTheMostConnectionsGivesWayAndStationsHavePlaces) {
  // one place for newcomers, four for stations, eleven for people
  RunningServer server([](ServerOptions& options) { options.max_connections = 16; });
  const std::string key = server.addStation("bench-1");
  for (const char* name : {"anna", "bert"}) server.addUser(name, pb::INSTRUCTOR, kPassword);
  std::vector<BlockingClient> annas;
  for (int i = 0; i < 11; ++i) {
    auto client =
        server.connect(i == 0 ? personLogin("anna", kPassword) : byToken(annas.front().welcome().token()));
    ASSERT_TRUE(client.ok()) << client.error().message;
    annas.push_back(std::move(*client));
  }
  pb::Request list;
  list.mutable_list_stations();
  EXPECT_TRUE(annas[0].call(list).ok());  // now the second one has been idle longest
  auto bert = server.connect(personLogin("bert", kPassword));
  ASSERT_TRUE(bert.ok()) << bert.error().message;
  const pb::Refusal refusal = waitForRefusal(annas[1]);
  EXPECT_EQ(refusal.reason(), pb::Refusal::RATE_LIMITED);
  EXPECT_TRUE(refusal.fatal());
  auto station = server.connect(stationLogin("bench-1", key));
  EXPECT_TRUE(station.ok());
  for (std::size_t i = 2; i < annas.size(); ++i) EXPECT_TRUE(annas[i].call(list).ok()) << i;
  EXPECT_TRUE(annas[0].call(list).ok());
  EXPECT_TRUE(bert->call(list).ok());
}

TEST(Access, aFloodOfPingsIsRefusedAndThenEndsTheConnection) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.small_messages_at_once = 50;
    options.bounds.small_messages_per_s = 1;
    options.bounds.refusals = 20;
  });
  RawPeer peer(server);
  ASSERT_TRUE(peer.logIn(stationLogin("bench-1", server.addStation("bench-1"))).has_welcome());
  pb::Envelope ping;
  ping.mutable_ping()->set_id(1);
  std::string flood;
  for (int i = 0; i < 500; ++i) flood += RawPeer::framed(ping);
  peer.write(flood);
  int pongs = 0, limited = 0;
  for (const auto& got : peer.readAll()) {
    pongs += got.has_pong() ? 1 : 0;
    limited += got.has_refusal() && got.refusal().reason() == pb::Refusal::RATE_LIMITED ? 1 : 0;
  }
  EXPECT_TRUE(peer.closed());
  EXPECT_GE(pongs, 40);
  EXPECT_LE(pongs, 60);
  EXPECT_EQ(limited, 21) << "20, and the last one for good";
}

// The finding: a log-in costs 2 ms, and each new connection got a burst of 5,000 messages.
TEST(Access, aStationsBurstIsSharedByAllItsConnections) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.small_messages_at_once = 50;
    options.bounds.small_messages_per_s = 1e-9;
  });
  const std::string key = server.addStation("bench-1"), other = server.addStation("bench-2");
  pb::Envelope ping;
  ping.mutable_ping()->set_id(1);
  const auto pongsOf = [&](const pb::Login& login) {
    RawPeer peer(server);
    EXPECT_TRUE(peer.logIn(login).has_welcome());
    for (int i = 0; i < 20; ++i) peer.send(ping);
    int pongs = 0;
    for (int answers = 0; answers < 20;) {
      const auto got = peer.receive();
      if (!got) break;
      pongs += got->has_pong() ? 1 : 0;
      answers += got->has_pong() || got->has_refusal() ? 1 : 0;
    }
    return pongs;
  };
  std::vector<int> pongs;
  for (int connection = 0; connection < 4; ++connection)
    pongs.push_back(pongsOf(stationLogin("bench-1", key)));
  EXPECT_EQ(pongs, (std::vector<int>{20, 20, 10, 0}));
  EXPECT_EQ(pongsOf(stationLogin("bench-2", other)), 20);
}

}  // namespace
}  // namespace needlelab
