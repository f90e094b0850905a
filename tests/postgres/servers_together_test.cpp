// Two servers on one database, over TLS: when a station logs in at one of them, the other loses it.
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "client/admin/command.h"
#include "common/base/text/uuid.h"
#include "db/sessions/session_store.h"
#include "db/sessions/station_claims.h"
#include "db/store/schema.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

void together(ServerOptions& options) {
  options.together = true;
  options.erasures_every = std::chrono::milliseconds(100);
}

/// Server `a`, which created the database, and `b`, whose folder was made from a's while a ran.
class TwoServers : public testing::Test {
 protected:
  TwoServers() {
    // the names that a server's start requires in its certificate: both servers are on this machine
    std::array<char, 256> machine{};
    (void)gethostname(machine.data(), machine.size() - 1);
    const std::string folder = dataOfB().string(), from = (a.folder() / "data").string();
    const char* const typed[] = {"needlelab-admin", "--data",      folder.c_str(), "server", "join",
                                 "--from",          from.c_str(),  "--name",       "b",      "--host-name",
                                 "127.0.0.1",       "--host-name", machine.data()};
    std::ostringstream out, err;
    if (runAdmin(static_cast<int>(std::size(typed)), typed, out, err) != 0)
      throw std::runtime_error(err.str());
    b.emplace([this](ServerOptions& options) {
      together(options);
      options.data = dataOfB();
      // the folder contains the database's address
      options.store_url = readStoreFile(options.data)->value().url;
    });
    key = a.addStation("bench-1");
  }
  [[nodiscard]] std::filesystem::path dataOfB() const { return folder_b.path() / "data"; }

  BlockingClient logIn(RunningServer& server) {
    auto client = server.connect(stationLogin("bench-1", key));
    if (!client) throw std::runtime_error(client.error().message);
    return std::move(*client);
  }
  static void open(BlockingClient& client, const FakeSession& session) {
    ASSERT_TRUE(client.send(session.open()).ok());
    (void)waitFor(client, [](const pb::Envelope& e) { return e.has_session_opened(); });
  }
  /// Everything received until the server closes.
  static std::vector<pb::Envelope> untilClosed(BlockingClient& client) {
    std::vector<pb::Envelope> all;
    for (;;) {
      auto got = client.receive(kPatience);
      if (!got.ok()) return all;
      all.push_back(std::move(*got));
    }
  }
  std::int64_t rows(const std::string& sql) {
    auto reader = a.server().store().readers().borrow();
    if (!reader) throw std::runtime_error(reader.error().message);
    auto row = (*reader)->prepare(sql);
    const auto there = row.step();
    return there && *there ? row.integer(0) : -1;
  }
  /// Expects that everything from this connection is refused for good, and nothing is acknowledged beyond
  /// `acked` chunks.
  static void expectDeposed(BlockingClient& client, std::uint64_t acked) {
    std::size_t deposed = 0;
    for (const pb::Envelope& envelope : untilClosed(client)) {
      EXPECT_FALSE(envelope.has_session_opened() || envelope.has_session_closed())
          << envelope.ShortDebugString();
      if (envelope.has_ack()) EXPECT_LE(envelope.ack().committed_seqs(), acked);
      if (!envelope.has_refusal()) continue;
      ++deposed;
      EXPECT_EQ(envelope.refusal().reason(), pb::Refusal::DEPOSED) << envelope.refusal().text();
      EXPECT_TRUE(envelope.refusal().fatal());
      EXPECT_THAT(envelope.refusal().text(), HasSubstr("at the server 'b'"));
    }
    EXPECT_EQ(deposed, 1u);
  }

  TempFolder folder_b;
  RunningServer a{together};
  std::optional<RunningServer> b;
  std::string key;
};

TEST_F(TwoServers, aStationThatLogsInElsewhereGoesOnThere) {
  FakeSession session("bench-1");
  BlockingClient old = logIn(a);
  open(old, session);
  ASSERT_TRUE(old.send(session.chunk(0)).ok());
  session.waitForAck(old, 1);

  BlockingClient now = logIn(*b);
  EXPECT_EQ(now.welcome().keepalive_ms(), 1'000u) << "who hears nothing for three times as long leaves";
  ASSERT_EQ(now.welcome().open_sessions_size(), 1);
  EXPECT_EQ(now.welcome().open_sessions(0).next_seq(), 1u);
  ASSERT_TRUE(now.send(session.chunk(1)).ok());
  session.waitForAck(now, 2);

  // in transit to the first one: one already known there, and the next one
  ASSERT_TRUE(old.send(session.chunk(1)).ok());
  ASSERT_TRUE(old.send(session.chunk(2)).ok());
  expectDeposed(old, 1);
  EXPECT_EQ(rows("SELECT count(*) FROM chunks"), 2);

  ASSERT_TRUE(now.send(session.chunk(2)).ok());
  session.waitForAck(now, 3);
  ASSERT_TRUE(now.send(session.close(3)).ok());
  const auto closed = waitFor(now, [](const pb::Envelope& e) { return e.has_session_closed(); });
  EXPECT_EQ(closed.session_closed().state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(rows("SELECT count(*) FROM chunks"), 3);
  EXPECT_EQ(rows("SELECT epoch FROM station_claims WHERE station = 'bench-1' AND server = 'b'"), 2);

  // and moves back
  BlockingClient back = logIn(a);
  FakeSession next("bench-1");
  open(back, next);
}

TEST_F(TwoServers, aCloseAndABeginningByTheOlderLogInAreRefused) {
  FakeSession session("bench-1"), other("bench-1");
  for (const bool is_close : {true, false}) {
    BlockingClient old = logIn(a);
    open(old, session);
    ASSERT_TRUE(old.send(session.chunk(0)).ok());
    session.waitForAck(old, 1);
    BlockingClient now = logIn(*b);
    ASSERT_TRUE(old.send(is_close ? session.close(1) : other.open()).ok());
    expectDeposed(old, 1);
    EXPECT_EQ(rows("SELECT count(*) FROM sessions"), 1);
    EXPECT_EQ(rows("SELECT count(*) FROM sessions WHERE state = 1"), 1) << "open";
  }
}

TEST_F(TwoServers, aClockOffsetByTheOlderLogInIsNotStored) {
  FakeSession session("bench-1");
  BlockingClient old = logIn(a);
  open(old, session);
  BlockingClient now = logIn(*b);
  const auto offsetOf = [&](BlockingClient& client, std::int64_t offset_ns) {
    pb::Envelope envelope;
    envelope.mutable_clock_offset()->set_session_id(session.id());
    envelope.mutable_clock_offset()->set_offset_ns(offset_ns);
    envelope.mutable_clock_offset()->set_round_trip_ns(10);
    ASSERT_TRUE(client.send(envelope).ok());
  };
  offsetOf(old, 7);
  // after it in the same queue
  ASSERT_TRUE(old.send(session.chunk(0)).ok());
  expectDeposed(old, 0);
  EXPECT_EQ(rows("SELECT count(*) FROM sessions WHERE clock_offset_ns IS NOT NULL"), 0);
  offsetOf(now, 8);
  ASSERT_TRUE(now.send(session.chunk(0)).ok());
  session.waitForAck(now, 1);
  EXPECT_EQ(rows("SELECT clock_offset_ns FROM sessions"), 8);
}

TEST_F(TwoServers, aStationLearnsOfABackupVerifiedThroughAnotherServer) {
  FakeSession session("bench-1");
  BlockingClient station = logIn(*b);
  open(station, session);
  ASSERT_TRUE(station.send(session.chunk(0)).ok());
  session.waitForAck(station, 1);
  Uuid id;
  std::copy_n(session.id().begin(), id.size(), id.begin());
  ASSERT_TRUE(a.server()
                  .store()
                  .writer()
                  .run([&](Connection& c) -> Status {
                    RETURN_IF_ERROR(SessionStore(c).markSafe(id, 1));
                    return MetaStore(c).set("backup_unix_ns", "7");
                  })
                  .ok());
  const auto safe =
      waitFor(station, [](const pb::Envelope& e) { return e.has_ack() && e.ack().safe_seqs() > 0; });
  EXPECT_EQ(safe.ack().safe_seqs(), 1u);
}

TEST_F(TwoServers, aSecondLogInAtTheSameServerClosesTheOlder) {
  BlockingClient older = logIn(a), newer = logIn(a);
  const auto refusal = waitForRefusal(older);
  EXPECT_EQ(refusal.reason(), pb::Refusal::CONFLICT);
  EXPECT_TRUE(refusal.fatal());
  FakeSession session("bench-1");
  open(newer, session);
  ASSERT_TRUE(newer.send(session.chunk(0)).ok());
  session.waitForAck(newer, 1);
  EXPECT_EQ(rows("SELECT epoch FROM station_claims WHERE server = 'first'"), 2);
}

TEST_F(TwoServers, aServerThatIsAloneClaimsNothing) {
  (void)a.stop();
  (void)b->stop();
  RunningServer alone;
  auto client = alone.connect(stationLogin("bench-1", alone.addStation("bench-1")));
  ASSERT_TRUE(client.ok()) << client.error().message;
  auto reader = alone.server().store().readers().borrow();
  ASSERT_TRUE(reader.ok());
  auto row = (*reader)->prepare("SELECT count(*) FROM station_claims");
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.integer(0), 0);
}

}  // namespace
}  // namespace needlelab::test
