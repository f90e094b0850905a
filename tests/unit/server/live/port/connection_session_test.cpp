#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <future>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/bytes.h"
#include "tests/unit/server/live/log_lines.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

struct StationAndServer {
  RunningServer server;
  std::string key = server.addStation("bench-1");
  FakeSession session{"bench-1"};
  BlockingClient client = std::move(*server.connect(stationLogin("bench-1", key)));

  std::uint64_t open() {
    EXPECT_TRUE(client.send(session.open()).ok());
    return waitFor(client, [](const pb::Envelope& e) { return e.has_session_opened(); })
        .session_opened()
        .next_seq();
  }
  void reconnect() { client = std::move(*server.connect(stationLogin("bench-1", key))); }
  pb::SessionInfo stored() {
    pb::Request request;
    request.mutable_get_session()->set_session_id(session.id());
    return server.asAdmin(request).session();
  }
};

int linesOf(RunningServer& server, const std::string& action) {
  pb::Request audit;
  audit.mutable_list_audit()->set_action(action);
  return server.asAdmin(audit).audit().entries_size();
}

TEST(ConnectionSession, chunksAreAcknowledgedAfterTheyAreStored) {
  StationAndServer s;
  EXPECT_EQ(s.open(), 0u);
  for (std::uint64_t seq = 0; seq < 10; ++seq) ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
  s.session.waitForAck(s.client, 10);
  const auto info = s.stored();
  EXPECT_EQ(info.chunks(), 10u);
  EXPECT_EQ(info.samples(), 1000u);
  EXPECT_EQ(info.state(), pb::SESSION_OPEN);
}

TEST(ConnectionSession, aRepeatedChunkIsAcknowledgedAndStoredOnce) {
  StationAndServer s;
  s.open();
  for (const std::uint64_t seq : {0, 1, 1, 0, 1, 2}) ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
  s.session.waitForAck(s.client, 3);
  EXPECT_EQ(s.stored().chunks(), 3u);
  EXPECT_EQ(s.stored().samples(), 300u);
}

TEST(ConnectionSession, aGapIsRefusedAndTheExpectedOneNamed) {
  StationAndServer s;
  s.open();
  ASSERT_TRUE(s.client.send(s.session.chunk(0)).ok());
  ASSERT_TRUE(s.client.send(s.session.chunk(2)).ok());
  const auto refusal = waitForRefusal(s.client);
  EXPECT_EQ(refusal.reason(), pb::Refusal::GAP);
  EXPECT_EQ(refusal.expected_seq(), 1u);
  EXPECT_EQ(refusal.session_id(), s.session.id());
  EXPECT_FALSE(refusal.fatal());
  // The station continues from there.
  for (const std::uint64_t seq : {1, 2}) ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
  s.session.waitForAck(s.client, 3);
}

TEST(ConnectionSession, aContradictionIsRefusedAndWrittenDown) {
  StationAndServer s;
  s.open();
  ASSERT_TRUE(s.client.send(s.session.chunk(0)).ok());
  s.session.waitForAck(s.client, 1);
  ASSERT_TRUE(s.client.send(s.session.chunk(0, 0.5)).ok());
  const auto refusal = waitForRefusal(s.client);
  EXPECT_EQ(refusal.reason(), pb::Refusal::CONTRADICTION);
  // The first one stays, and the audit log records this.
  pb::Request read;
  read.mutable_read_chunks()->set_session_id(s.session.id());
  read.mutable_read_chunks()->set_max_chunks(10);
  const auto chunks = s.server.asAdmin(read).chunks();
  ASSERT_EQ(chunks.chunks_size(), 1);
  EXPECT_EQ(chunks.chunks(0).data(), s.session.chunk(0).chunk().data());
  EXPECT_EQ(linesOf(s.server, "chunk contradicts"), 1);
}

TEST(ConnectionSession, repeatedContradictionsAreOneLineAndEndTheConnection) {
  constexpr int kConnections = 3, kEach = 50;
  StationAndServer s;
  s.open();
  ASSERT_TRUE(s.client.send(s.session.chunk(0)).ok());
  s.session.waitForAck(s.client, 1);
  pb::Envelope one_byte = s.session.chunk(0);
  one_byte.mutable_chunk()->set_data("x");
  for (int n = 0; n < kConnections; ++n) {
    for (int chunk = 0; chunk < kEach; ++chunk) ASSERT_TRUE(s.client.send(one_byte).ok());
    const auto refusal = waitForRefusal(s.client);
    EXPECT_EQ(refusal.reason(), pb::Refusal::CONTRADICTION);
    EXPECT_TRUE(refusal.fatal());
    // it is written with the commit that the refusal waits for; no request thread is involved
    EXPECT_EQ(linesOf(s.server, "chunk contradicts"), 1);
    s.reconnect();
  }
  // its other sessions continue
  const FakeSession other("bench-1");
  ASSERT_TRUE(s.client.send(other.open()).ok());
  ASSERT_TRUE(s.client.send(other.chunk(0)).ok());
  other.waitForAck(s.client, 1);
  EXPECT_EQ(s.server.stop(), 0);
  EXPECT_GE(s.server.counters().chunks_contradicting, static_cast<std::uint64_t>(kConnections));
  EXPECT_LE(s.server.counters().chunks_contradicting, static_cast<std::uint64_t>(kConnections * kEach));
}

TEST(ConnectionSession, aDamagedChunkIsRefusedAndNotStored) {
  StationAndServer s;
  s.open();
  pb::Envelope damaged = s.session.chunk(0);
  std::string& data = *damaged.mutable_chunk()->mutable_data();
  data[data.size() / 2] = static_cast<char>(data[data.size() / 2] ^ 0x10);
  ASSERT_TRUE(s.client.send(damaged).ok());
  EXPECT_EQ(waitForRefusal(s.client).reason(), pb::Refusal::INVALID);
  EXPECT_EQ(s.stored().chunks(), 0u);
}

/// From a station with a faulty encoder, or a hostile one: the CRC is right, the columns are impossible.
pb::Envelope undecodable(const FakeSession& session, std::uint64_t seq) {
  pb::Envelope impossible = session.chunk(seq);
  std::string& data = *impossible.mutable_chunk()->mutable_data();
  data[16] = static_cast<char>(data[16] ^ 1);  // another last tick
  const std::uint32_t crc = crc32c(viewOf(data).first(data.size() - 4));
  std::memcpy(data.data() + data.size() - 4, &crc, 4);
  return impossible;
}

TEST(ConnectionSession, anUndecodableChunkIsQuarantinedAndTheSessionContinues) {
  StationAndServer s;
  s.open();
  ASSERT_TRUE(s.client.send(s.session.chunk(0)).ok());
  ASSERT_TRUE(s.client.send(undecodable(s.session, 1)).ok());
  ASSERT_TRUE(s.client.send(s.session.chunk(2)).ok());
  s.session.waitForAck(s.client, 3);
  EXPECT_EQ(s.stored().chunks(), 3u);
  EXPECT_EQ(s.stored().quarantined_chunks(), 1u);
  pb::Request verify;
  verify.mutable_verify_session()->set_session_id(s.session.id());
  EXPECT_FALSE(s.server.asAdmin(verify).verified().ok());
  EXPECT_THAT(s.server.asAdmin(verify).verified().text(), HasSubstr("chunk 1: "));
  pb::Request audit;
  audit.mutable_list_audit()->set_action("chunk quarantine");
  EXPECT_EQ(s.server.asAdmin(audit).audit().entries_size(), 1);
}

// The finding: each had its own line, 0.4 MB per second.
TEST(ConnectionSession, undecodableChunkLinesAreBoundedAndCounted) {
  constexpr std::uint64_t kLines = 2, kChunks = 7;
  RunningServer server([](ServerOptions& options) { options.bounds.log_lines.a_minute = kLines; });
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok()) << station.error().message;
  const FakeSession session("bench-1");
  const std::string log = logOf(LogLevel::kWarning, [&] {
    ASSERT_TRUE(station->send(session.open()).ok());
    for (std::uint64_t seq = 0; seq < kChunks; ++seq)
      ASSERT_TRUE(station->send(undecodable(session, seq)).ok());
    session.waitForAck(*station, kChunks);
    server.stop();
  });
  EXPECT_EQ(server.counters().chunks_quarantined, kChunks) << "all are counted";
  EXPECT_EQ(countOf(log, "chunk_quarantined conn="), kLines) << log;
  EXPECT_EQ(countOf(log, leftOut("\"station bench-1\"", "chunk_quarantined", kChunks - kLines)), 1u) << log;
}

TEST(ConnectionSession, sessionsOfOthersAreUnknown) {
  StationAndServer s;
  s.open();
  auto other = s.server.connect(stationLogin("bench-2", s.server.addStation("bench-2")));
  ASSERT_TRUE(other.ok());
  // It opens its own session first, so that it is in a session.
  FakeSession own("bench-2");
  ASSERT_TRUE(other->send(own.open()).ok());
  ASSERT_TRUE(other->send(s.session.chunk(0)).ok());
  EXPECT_EQ(waitForRefusal(*other).reason(), pb::Refusal::UNKNOWN_SESSION);
  // A session cannot be opened in another station's name either.
  ASSERT_TRUE(other->send(FakeSession("bench-1").open()).ok());
  EXPECT_EQ(waitForRefusal(*other).reason(), pb::Refusal::INVALID);
  EXPECT_EQ(s.stored().chunks(), 0u);
}

TEST(ConnectionSession, aSessionClosesWhenCountSamplesAndHashAgree) {
  StationAndServer s;
  s.open();
  for (std::uint64_t seq = 0; seq < 3; ++seq) ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
  // All in one write: the server commits the chunks before it closes.
  ASSERT_TRUE(s.client.send(s.session.close(3)).ok());
  const auto closed =
      waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_closed(); }).session_closed();
  EXPECT_EQ(closed.state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(s.stored().state(), pb::SESSION_COMPLETE);
  // repeated after a lost answer
  s.reconnect();
  EXPECT_EQ(s.client.welcome().open_sessions_size(), 0);
  EXPECT_EQ(s.open(), 3u);
  ASSERT_TRUE(s.client.send(s.session.close(3)).ok());
  EXPECT_EQ(waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_closed(); })
                .session_closed()
                .state(),
            pb::SESSION_COMPLETE);
}

// the station lost the answer to its first CloseSession, and another session's close comes in between
TEST(ConnectionSession, aSessionMayBeClosedAgainWhileAnotherOneCloses) {
  StationAndServer s;
  s.open();
  ASSERT_TRUE(s.client.send(s.session.close(0)).ok());
  const auto isClosed = [&](const std::string& id) {
    return [id](const pb::Envelope& e) {
      return e.has_session_closed() && e.session_closed().session_id() == id;
    };
  };
  waitFor(s.client, isClosed(s.session.id()));
  s.reconnect();
  FakeSession other("bench-1");
  s.open();
  ASSERT_TRUE(s.client.send(other.open()).ok());
  ASSERT_TRUE(s.client.send(other.close(0)).ok());
  waitFor(s.client, isClosed(other.id()));
  ASSERT_TRUE(s.client.send(s.session.close(0)).ok());
  const auto answer =
      waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_closed() || e.has_refusal(); });
  EXPECT_EQ(answer.session_closed().session_id(), s.session.id()) << answer.ShortDebugString();
}

TEST(ConnectionSession, closingTooEarlyOrWithAnotherHashIsRefused) {
  StationAndServer s;
  s.open();
  for (std::uint64_t seq = 0; seq < 2; ++seq) ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
  ASSERT_TRUE(s.client.send(s.session.close(3)).ok());
  const auto early = waitForRefusal(s.client);
  EXPECT_EQ(early.reason(), pb::Refusal::GAP);
  EXPECT_EQ(early.expected_seq(), 2u);
  auto wrong = s.session.close(2);
  (*wrong.mutable_close_session()->mutable_hash())[0] ^= 1;
  ASSERT_TRUE(s.client.send(wrong).ok());
  EXPECT_EQ(waitForRefusal(s.client).reason(), pb::Refusal::CONTRADICTION);
  EXPECT_EQ(s.stored().state(), pb::SESSION_OPEN);
  ASSERT_TRUE(s.client.send(s.session.close(2)).ok());
  (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_closed(); });
}

/// Blocks a server's writer, and with it every close, which waits there for the chunks before it.
class HeldWriter {
 public:
  explicit HeldWriter(Server& server) {
    const auto began = std::make_shared<std::promise<void>>();
    DbWriter::Work wait = [held = go_.get_future().share(), began](Connection&) {
      began->set_value();
      held.wait();
      return Status();
    };
    EXPECT_TRUE(server.store().writer().post(std::move(wait), {}).ok());
    // later posts are in another group and wait
    began->get_future().wait();
  }
  ~HeldWriter() { release(); }
  void release() {
    if (!std::exchange(released_, true)) go_.set_value();
  }

 private:
  std::promise<void> go_;
  bool released_ = false;
};

std::vector<FakeSession> openSessions(StationAndServer& s, int count) {
  std::vector<FakeSession> sessions;
  for (int n = 0; n < count; ++n) {
    sessions.emplace_back("bench-1");
    EXPECT_TRUE(s.client.send(sessions.back().open()).ok());
    sessions.back().waitForAck(s.client, 0);  // it comes after SessionOpened
  }
  return sessions;
}

pb::Envelope ping(std::uint64_t id) {
  pb::Envelope envelope;
  envelope.mutable_ping()->set_id(id);
  return envelope;
}

TEST(Closes, aStationsNinthCloseIsDeferredAndItsRequestsAnswered) {
  StationAndServer s;
  const auto sessions = openSessions(s, 9);
  HeldWriter held(s.server.server());
  for (const FakeSession& session : sessions) ASSERT_TRUE(s.client.send(session.close(0)).ok());
  const auto refusal = waitForRefusal(s.client);
  EXPECT_EQ(refusal.reason(), pb::Refusal::RATE_LIMITED);
  EXPECT_FALSE(refusal.fatal());
  EXPECT_EQ(refusal.session_id(), sessions[8].id());
  EXPECT_THAT(refusal.text(), HasSubstr("8 sessions of this station are being closed"));
  pb::Request list;
  list.mutable_list_profiles();
  EXPECT_TRUE(s.client.call(list).ok());
  held.release();
  const auto isClosed = [](const pb::Envelope& e) { return e.has_session_closed(); };
  for (int n = 0; n < 8; ++n) (void)waitFor(s.client, isClosed);
  ASSERT_TRUE(s.client.send(sessions[8].close(0)).ok());
  EXPECT_EQ(waitFor(s.client, isClosed).session_closed().session_id(), sessions[8].id());
}

// What a replaced connection sent is still in the writer's queue.
TEST(Chunks, ofAStationAreBoundedOverAllItsConnections) {
  constexpr std::size_t kAtOnce = 16, kLogIns = 5;
  StationAndServer s{
      .server = RunningServer([](ServerOptions& options) { options.bounds.chunks_in_flight = kAtOnce; })};
  s.open();
  HeldWriter held(s.server.server());
  const auto waiting = [&s] { return s.server.server().store().writer().counters().waiting; };
  for (std::size_t n = 0; n < kLogIns; ++n) {
    for (std::uint64_t seq = 0; seq < 4 * kAtOnce; ++seq)
      ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
    // the client sends while it receives
    do {
      (void)s.client.receive(milliseconds(1));
    } while (waiting() < kAtOnce);
    auto newer = s.server.connect(stationLogin("bench-1", s.key));
    ASSERT_TRUE(newer.ok());
    s.client = std::move(*newer);
  }
  EXPECT_EQ(waiting(), kAtOnce) << "those of the first connection";
  held.release();
  ASSERT_TRUE(s.client.send(s.session.chunk(0)).ok());
  s.session.waitForAck(s.client, kAtOnce);
}

TEST(Closes, anEndedConnectionsWaitingClosesAreDroppedAndRetried) {
  StationAndServer s;
  const auto sessions = openSessions(s, 8);
  HeldWriter held(s.server.server());
  for (const FakeSession& session : sessions) ASSERT_TRUE(s.client.send(session.close(0)).ok());
  ASSERT_TRUE(s.client.send(ping(7)).ok());
  (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_pong() && e.pong().id() == 7; });
  // an ending server accepts no connections, as on SIGTERM
  auto config = s.server.config(stationLogin("bench-1", s.key));
  auto ended = std::async(std::launch::async, [&] { return s.server.stop(); });
  while (BlockingClient::connect(config).ok()) continue;
  held.release();
  EXPECT_EQ(ended.get(), 0);
  s.server.start();
  s.reconnect();
  EXPECT_EQ(s.client.welcome().open_sessions_size(), 8) << "none was closed";
  ASSERT_TRUE(s.client.send(sessions[0].open()).ok());
  (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_opened(); });
  ASSERT_TRUE(s.client.send(sessions[0].close(0)).ok());
  (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_closed(); });
}

TEST(Closes, anIdOrHashOfWrongLengthIsRefusedAtOnce) {
  StationAndServer s;
  s.open();
  HeldWriter held(s.server.server());
  for (const std::size_t bytes : {1u, 31u, 33u, 4'000u}) {
    auto close = s.session.close(0);
    close.mutable_close_session()->set_hash(std::string(bytes, 'h'));
    ASSERT_TRUE(s.client.send(close).ok());
    const auto refusal = waitForRefusal(s.client);
    EXPECT_EQ(refusal.reason(), pb::Refusal::INVALID);
    EXPECT_EQ(refusal.session_id(), s.session.id());
    EXPECT_EQ(refusal.text(), "close_session.hash has " + std::to_string(bytes) + " bytes, not 32 or none");
  }
  for (const std::size_t bytes : {0u, 15u, 17u, 4'000u}) {
    auto close = s.session.close(0);
    close.mutable_close_session()->set_session_id(std::string(bytes, 'i'));
    ASSERT_TRUE(s.client.send(close).ok());
    const auto refusal = waitForRefusal(s.client);
    EXPECT_EQ(refusal.reason(), pb::Refusal::INVALID);
    EXPECT_EQ(refusal.session_id(), "");
    EXPECT_EQ(refusal.text(), "close_session.session_id has " + std::to_string(bytes) + " bytes, not 16");
  }
}

/// A close with this many fields of a newer version, 3 bytes each.
pb::Envelope closeWithMore(const FakeSession& session, int fields) {
  auto close = session.close(0);
  pb::CloseSession& message = *close.mutable_close_session();
  for (int i = 0; i < fields; ++i) message.GetReflection()->MutableUnknownFields(&message)->AddVarint(777, 1);
  return close;
}

TEST(Closes, aMessageThatIsLongerThanAnyCloseIsRefusedUnparsed) {
  StationAndServer s;
  s.open();
  auto close = s.session.close(0);
  pb::CloseSession& message = *close.mutable_close_session();
  // plus a two-byte tag and a two-byte length
  const std::size_t pad = 4096 - message.ByteSizeLong() - 4;
  auto& unknown = *message.GetReflection()->MutableUnknownFields(&message);
  unknown.AddLengthDelimited(777, std::string(pad + 1, 'x'));
  ASSERT_EQ(message.ByteSizeLong(), 4097u);
  ASSERT_TRUE(s.client.send(close).ok());
  const auto refusal = waitForRefusal(s.client);
  EXPECT_EQ(refusal.reason(), pb::Refusal::INVALID);
  EXPECT_FALSE(refusal.fatal());
  EXPECT_EQ(refusal.session_id(), s.session.id());
  EXPECT_EQ(refusal.text(), "close_session has 4097 bytes, at most 4096 are allowed");
  unknown.Clear();
  unknown.AddLengthDelimited(777, std::string(pad, 'x'));
  ASSERT_EQ(message.ByteSizeLong(), 4096u);
  ASSERT_TRUE(s.client.send(close).ok());
  (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_closed(); });
  s.client.finish();
  EXPECT_EQ(s.server.stop(), 0);
  EXPECT_EQ(s.server.counters().messages_refused_unparsed, 1u);
}

// The finding: waiting closes held the memory of unknown fields that were discarded, 8 MiB for one station,
// and other stations' OpenSession had to wait for it.
TEST(Closes, thoseThatWaitHaveNoPartInTheBudget) {
  StationAndServer s{
      .server = RunningServer([](ServerOptions& options) { options.bounds.decoded.station = 100'000; })};
  const auto sessions = openSessions(s, 5);
  HeldWriter held(s.server.server());
  // 64 kB each while they are parsed: no two fit
  for (const FakeSession& session : sessions) ASSERT_TRUE(s.client.send(closeWithMore(session, 1000)).ok());
  ASSERT_TRUE(s.client.send(ping(7)).ok());
  (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_pong() && e.pong().id() == 7; });
  held.release();
  for (std::size_t n = 0; n < sessions.size(); ++n)
    (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_session_closed(); });
}

TEST(ConnectionSession, afterARestartTheServerResumesWhereTheDatabaseEnds) {
  StationAndServer s;
  s.open();
  for (std::uint64_t seq = 0; seq < 7; ++seq) ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
  s.session.waitForAck(s.client, 7);
  EXPECT_EQ(s.server.restart(), 0);
  EXPECT_FALSE(s.client.receive(kPatience).ok() && s.client.receive(kPatience).ok());
  s.reconnect();
  ASSERT_EQ(s.client.welcome().open_sessions_size(), 1);
  EXPECT_EQ(s.client.welcome().open_sessions(0).session_id(), s.session.id());
  EXPECT_EQ(s.client.welcome().open_sessions(0).next_seq(), 7u);
  // The session is open: chunks may follow at once.
  ASSERT_TRUE(s.client.send(s.session.chunk(7)).ok());
  s.session.waitForAck(s.client, 8);
}

TEST(ConnectionSession, aFloodOfChunksIsBoundedAndAllOfItArrives) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.chunks_in_flight = 4;
    options.writer.window = milliseconds(20);
  });
  auto client = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(client.ok());
  FakeSession session("bench-1");
  ASSERT_TRUE(client->send(session.open()).ok());
  for (std::uint64_t seq = 0; seq < 100; ++seq) ASSERT_TRUE(client->send(session.chunk(seq)).ok());
  session.waitForAck(*client, 100);
}

TEST(ConnectionSession, manyStationsTogetherNeverOverrunTheWritersQueue) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.all_chunks_in_flight.chunks = 8;
    options.writer.max_items = 24;  // one connection may have 64 chunks in progress
    options.writer.window = milliseconds(20);
  });
  constexpr int kStations = 4;
  std::vector<BlockingClient> clients;
  std::vector<FakeSession> sessions;
  for (int i = 0; i < kStations; ++i) {
    const std::string name = "bench-" + std::to_string(i);
    auto client = server.connect(stationLogin(name, server.addStation(name)));
    ASSERT_TRUE(client.ok());
    clients.push_back(std::move(*client));
    sessions.emplace_back(name);
  }
  for (int i = 0; i < kStations; ++i) {
    ASSERT_TRUE(clients[i].send(sessions[i].open()).ok());
    for (std::uint64_t seq = 0; seq < 100; ++seq) ASSERT_TRUE(clients[i].send(sessions[i].chunk(seq)).ok());
  }
  for (int i = 0; i < kStations; ++i) sessions[i].waitForAck(clients[i], 100);
}

TEST(ConnectionSession, aVerifiedBackupMovesTheSafeWatermark) {
  StationAndServer s;
  s.open();
  for (std::uint64_t seq = 0; seq < 4; ++seq) ASSERT_TRUE(s.client.send(s.session.chunk(seq)).ok());
  s.session.waitForAck(s.client, 4);
  s.server.addUser("chief", pb::ADMINISTRATOR, "another long password");
  auto chief = s.server.connect(personLogin("chief", "another long password"));
  ASSERT_TRUE(chief.ok());
  pb::Request backup;
  backup.mutable_backup()->set_path((s.server.folder() / "backup.db").string());
  backup.mutable_backup()->set_counts_as_safe(true);  // it is beside the database
  const auto done = chief->call(backup);
  ASSERT_TRUE(done.ok()) << done.error().message;
  const auto ack =
      waitFor(s.client, [](const pb::Envelope& e) { return e.has_ack() && e.ack().safe_seqs() > 0; });
  EXPECT_EQ(ack.ack().safe_seqs(), 3u) << "the last one with the session's end";
}

pb::Envelope clockOffset(const FakeSession& session, std::int64_t offset_ns, std::int64_t round_trip_ns) {
  pb::Envelope envelope;
  envelope.mutable_clock_offset()->set_session_id(session.id());
  envelope.mutable_clock_offset()->set_offset_ns(offset_ns);
  envelope.mutable_clock_offset()->set_round_trip_ns(round_trip_ns);
  return envelope;
}

// The finding: each ClockOffset was an item in the writer's queue; one station filled it, so other stations'
// chunks and people's changes were refused.
TEST(ConnectionSession, clockOffsetsDuringABusyWriterFormOneItem) {
  StationAndServer s;
  const auto sessions = openSessions(s, 3);
  HeldWriter held(s.server.server());
  DbWriter& writer = s.server.server().store().writer();
  while (writer.counters().waiting > 0) std::this_thread::yield();  // it has reached the item that blocks it
  constexpr int kEach = 100;
  for (int i = 0; i < kEach; ++i) {
    // in each session a different one is the best
    for (int n = 0; n < 3; ++n) {
      const int round_trip_ns = 1 + (i + 30 * n) % kEach;
      ASSERT_TRUE(s.client.send(clockOffset(sessions[n], 1000 * n + i, round_trip_ns)).ok());
    }
  }
  ASSERT_TRUE(s.client.send(ping(7)).ok());
  (void)waitFor(s.client, [](const pb::Envelope& e) { return e.has_pong() && e.pong().id() == 7; });
  EXPECT_EQ(writer.counters().waiting, 1u);
  held.release();
  ASSERT_TRUE(s.client.send(sessions[0].chunk(0)).ok());
  sessions[0].waitForAck(s.client, 1);
  for (int n = 0; n < 3; ++n) {
    pb::Request get;
    get.mutable_get_session()->set_session_id(sessions[n].id());
    const auto info = s.server.asAdmin(get).session();
    EXPECT_EQ(info.clock_offset_ns(), 1000 * n + (kEach - 30 * n) % kEach) << n;
    EXPECT_EQ(info.clock_round_trip_ns(), 1) << n;
  }
}

TEST(ConnectionSession, aClockOffsetWithoutARoundTripIsRefused) {
  StationAndServer s;
  s.open();
  for (const std::int64_t round_trip_ns : {std::int64_t{0}, std::int64_t{-5}}) {
    ASSERT_TRUE(s.client.send(clockOffset(s.session, 1, round_trip_ns)).ok());
    const auto refusal = waitForRefusal(s.client);
    EXPECT_EQ(refusal.reason(), pb::Refusal::INVALID);
    EXPECT_FALSE(refusal.fatal());
    EXPECT_EQ(refusal.session_id(), s.session.id());
    EXPECT_EQ(refusal.text(),
              "clock_offset.round_trip_ns is " + std::to_string(round_trip_ns) + ", allowed is above 0");
  }
}

}  // namespace
}  // namespace needlelab
