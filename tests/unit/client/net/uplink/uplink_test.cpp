#include "client/net/uplink/uplink.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "common/gesture/chunk.h"
#include "tests/support/patience.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"
#include "tests/unit/client/net/uplink/fake_server.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class UplinkTest : public testing::Test {
 protected:
  UplinkTest() { reopenSpool(); }
  void reopenSpool() {
    spool_.reset();
    auto spool = Spool::open(folder_.path());
    ASSERT_TRUE(spool.ok()) << spool.error().message;
    spool_ = std::move(*spool);
  }
  std::shared_ptr<SpoolSession> makeSession(std::uint64_t chunks, bool ended, std::size_t samples = 50) {
    auto session = *spool_->create(describeSession(makeUuidV7()));
    addChunks(*session, 0, chunks, samples);
    if (ended) {
      EXPECT_TRUE(session->end(false).ok());
    }
    return session;
  }
  static void addChunks(SpoolSession& session, std::uint64_t first, std::uint64_t count,
                        std::size_t samples = 50) {
    for (std::uint64_t seq = first; seq < first + count; ++seq)
      ASSERT_TRUE(
          session
              .appendChunk(encodeChunk(Resolution::standard(), samplesFrom(seq * samples, samples)), samples)
              .ok());
    ASSERT_TRUE(session.sync().ok());
  }
  std::unique_ptr<Uplink> connected(const ClientConfig& client,
                                    std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>()) {
    UplinkConfig config;
    config.client = client;
    config.first_retry = 20ms;
    config.max_retry = 100ms;
    config.clock = std::move(clock);
    UplinkEvents events;
    events.report = [this](const std::string& text) { note(text); };
    events.trainee_message = [this](const pb::TraineeMessage& message) { note("message " + message.text()); };
    events.next_exercise = [this](const pb::NextExercise& next) { note("next " + next.exercise_id()); };
    events.set_aids = [this](const pb::SetAids& set) {
      note("aids of " + set.from() + ": " + std::to_string(set.aids_size()) + (set.reset() ? " reset" : ""));
    };
    events.stop_lesson = [this](const pb::StopLesson& stop) { note("stop: " + stop.reason()); };
    return std::make_unique<Uplink>(config, events);
  }
  void note(const std::string& text) {
    const std::scoped_lock lock(mutex_);
    said_.push_back(text);
  }
  std::vector<std::string> said() {
    const std::scoped_lock lock(mutex_);
    return said_;
  }
  // The server has the same chunks as the spool, and they match the hash that it received.
  static void expectWhole(const KeptSession& kept, const SpoolSession& session) {
    const SpoolContents contents = session.contents();
    ASSERT_EQ(kept.chunks.size(), contents.chunks);
    SessionHash hash;
    for (std::uint64_t seq = 0; seq < contents.chunks; ++seq) {
      ASSERT_EQ(kept.chunks[seq], std::string(textOf(*session.readChunk(seq))));
      hash.update(viewOf(kept.chunks[seq]));
    }
    const Digest digest = hash.digest();
    EXPECT_TRUE(kept.closed);
    EXPECT_EQ(kept.close.hash(), std::string(digest.begin(), digest.end()));
    EXPECT_EQ(kept.close.chunks(), contents.chunks);
    EXPECT_EQ(kept.close.samples(), contents.samples);
  }
  KeptSession keptOf(FakeServer& server, const SpoolSession& session) {
    return server.sessions()[session.description().session_id()];
  }

  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
  std::mutex mutex_;
  std::vector<std::string> said_;
};

TEST_F(UplinkTest, aSessionThatGrowsIsUploadedAndClosed) {
  FakeServer server;
  auto session = makeSession(3, false);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  ASSERT_TRUE(eventually([&] { return uplink->state().current_committed == 3; }));
  addChunks(*session, 3, 4);
  uplink->wake();
  ASSERT_TRUE(eventually([&] { return uplink->state().current_committed == 7; }));
  EXPECT_FALSE(uplink->waitUntilDone(50ms)) << "it has not ended";
  ASSERT_TRUE(session->end(false).ok());
  uplink->wake();
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  expectWhole(keptOf(server, *session), *session);
  const UplinkState state = uplink->state();
  EXPECT_EQ(state.chunks_left, 0u);
  ASSERT_TRUE(state.current_verdict);
  EXPECT_EQ(state.current_verdict->state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(state.current_verdict->score_json(), "[]");
  uplink->stop();
  EXPECT_TRUE(session->receipt().closed);
  reopenSpool();
  EXPECT_TRUE(spool_->unfinished().empty()) << "a restart does not offer it again";
}

TEST_F(UplinkTest, theWindowHoldsAtMost64Chunks) {
  FakeServer server;
  server.faults.never_ack = true;
  auto session = makeSession(200, true, 5);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  ASSERT_TRUE(eventually([&] { return server.mostChunks() >= 64; }));
  // two more status lines mean that it had two more chances to send
  const std::uint64_t lines = server.statusLines();
  ASSERT_TRUE(eventually([&] { return server.statusLines() >= lines + 2; }));
  EXPECT_EQ(server.mostChunks(), 64u);
  EXPECT_EQ(uplink->state().chunks_left, 200u);
  server.faults.never_ack = false;
  server.ackNow();
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  expectWhole(keptOf(server, *session), *session);
}

TEST_F(UplinkTest, lostConnectionsAndLostAcksLoseAndDoubleNothing) {
  FakeServer server;
  auto session = makeSession(150, true, 5);
  server.faults.drop_after_chunks = 40;  // accepted but never acknowledged
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  const KeptSession kept = keptOf(server, *session);
  expectWhole(kept, *session);
  EXPECT_EQ(kept.opened, 2u);
  EXPECT_EQ(kept.repeated, 0u) << "the server's next_seq is believed, not the last ack";
  EXPECT_EQ(uplink->state().connections, 2u);
  EXPECT_THAT(said(), testing::Contains(HasSubstr("is lost")));
}

// Records the back-off's waits instead of waiting; time stands still.
class NotedWaits : public LinkClock {
 public:
  NotedWaits() : LinkClock(time_) {}
  Task<> wait(asio::steady_timer& timer, std::chrono::milliseconds time, LinkWait what) override {
    if (what != LinkWait::kRetry) co_return co_await LinkClock::wait(timer, time, what);
    if (time < ServerLink::kForever) {
      const std::scoped_lock lock(mutex_);
      waits_.push_back(time);
    }
    timer.expires_after(time < ServerLink::kForever ? 0ms : time);
    co_await timer.async_wait(kUseTuple);
  }
  std::vector<std::chrono::milliseconds> waits() {
    const std::scoped_lock lock(mutex_);
    return waits_;
  }

 private:
  FakeTime time_;
  std::mutex mutex_;
  std::vector<std::chrono::milliseconds> waits_;
};

TEST_F(UplinkTest, whoIsThrownOutAtOnceComesBackMoreAndMoreSlowly) {
  const auto clock = std::make_shared<NotedWaits>();
  FakeServer server;
  auto uplink = connected(server.clientConfig(), clock);
  for (std::uint64_t connection = 1; connection <= 6; ++connection) {
    ASSERT_TRUE(eventually([&] { return uplink->state().connections == connection; }));
    server.dropConnections();
  }
  ASSERT_TRUE(eventually([&] { return clock->waits().size() >= 6; }));
  const auto waits = clock->waits();
  const std::vector<std::chrono::milliseconds> most = {20ms, 40ms, 80ms, 100ms, 100ms, 100ms};
  for (std::size_t n = 0; n < most.size(); ++n) {
    EXPECT_GE(waits[n], most[n] / 2) << n;
    EXPECT_LE(waits[n], most[n]) << n;
  }
}

TEST_F(UplinkTest, aGapIsResentFromTheServersPosition) {
  FakeServer server;
  server.faults.forget_every_chunk = 37;
  auto session = makeSession(150, true, 5);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  // A forgotten last chunk is visible only by its missing ack; the next message reveals it.
  ASSERT_TRUE(eventually([&] { return keptOf(server, *session).chunks.size() >= 140; }));
  server.faults.forget_every_chunk = 0;
  if (!uplink->waitUntilDone(1s)) server.dropConnections();
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  expectWhole(keptOf(server, *session), *session);
}

TEST_F(UplinkTest, aSessionThatTheServerForgotIsOpenedAgain) {
  FakeServer server;
  server.faults.forget_session = true;
  auto session = makeSession(5, true);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  EXPECT_EQ(keptOf(server, *session).opened, 2u);
  expectWhole(keptOf(server, *session), *session);
}

TEST_F(UplinkTest, aContradictionParksItsSessionAndTheOthersReconnect) {
  FakeServer server;
  server.faults.contradict = true;
  auto bad = makeSession(3, true), good = makeSession(3, true);
  auto uplink = connected(server.clientConfig());
  uplink->add(bad, true);
  ASSERT_TRUE(eventually([&] { return !uplink->state().current_trouble.empty(); }));
  server.faults.contradict = false;
  uplink->add(good, false);
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  EXPECT_THAT(uplink->state().current_trouble, HasSubstr("the server refuses it: the test says so"));
  expectWhole(keptOf(server, *good), *good);
  EXPECT_EQ(uplink->state().chunks_left, 3u) << "the refused session still waits in the spool";
  uplink->stop();
  EXPECT_FALSE(bad->receipt().closed);
  EXPECT_TRUE(std::filesystem::exists(bad->folder() / "chunks"));
}

TEST_F(UplinkTest, oldSessionsUploadAlongsideTheCurrentOne) {
  FakeServer server;
  std::vector<std::shared_ptr<SpoolSession>> old;
  for (int i = 0; i < 4; ++i) old.push_back(makeSession(20, true));
  auto current = makeSession(2, false);
  auto uplink = connected(server.clientConfig());
  for (const auto& session : old) uplink->add(session, false);
  uplink->add(current, true);
  ASSERT_TRUE(eventually([&] { return uplink->state().sessions_open == 1; }));
  for (const auto& session : old) expectWhole(keptOf(server, *session), *session);
  EXPECT_EQ(keptOf(server, *current).chunks.size(), 2u);
}

// A window runs lesson after lesson over one uplink.
TEST_F(UplinkTest, theVerdictOnOneSessionIsNeverTakenForTheNextOnes) {
  FakeServer server;
  auto uplink = connected(server.clientConfig());
  for (int lesson = 0; lesson < 5; ++lesson) {
    auto session = makeSession(2, false);
    uplink->add(session, true);
    // from the moment it is added
    ASSERT_TRUE(eventually([&] {
      EXPECT_FALSE(uplink->state().current_verdict);
      return keptOf(server, *session).chunks.size() == 2;
    }));
    ASSERT_TRUE(session->end(false).ok());
    uplink->wake();
    ASSERT_TRUE(eventually([&] { return uplink->state().current_verdict.has_value(); }));
    EXPECT_EQ(uplink->state().current_verdict->session_id(), session->description().session_id());
    EXPECT_EQ(uplink->state().current_committed, 2u);
  }
}

TEST_F(UplinkTest, aQuestionOutsideALessonIsAnsweredOrRefused) {
  FakeServer server;
  auto uplink = connected(server.clientConfig());
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id("shoulder");
  const auto reply = uplink->ask(request, kPatience, false);
  ASSERT_TRUE(reply.ok()) << reply.error().message;
  EXPECT_TRUE(reply->has_lesson());
  request.mutable_get_lesson()->set_exercise_id("unknown");
  const auto refused = uplink->ask(request, kPatience, false);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
}

TEST_F(UplinkTest, anUnansweredQuestionChecksForStopsAndTimesOut) {
  FakeTime time;
  FakeServer server;
  auto uplink = connected(server.clientConfig(), std::make_shared<LinkClock>(time));
  ASSERT_TRUE(eventually([&] { return uplink->state().connected; }));
  const std::int64_t began_ns = time.nowNs();
  pb::Request mute;
  mute.mutable_list_curricula();
  std::vector<std::int64_t> looks_ms;
  const auto look = [&] { return looks_ms.push_back((time.nowNs() - began_ns) / 1'000'000), false; };
  EXPECT_EQ(uplink->ask(mute, 220ms, false, look).error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(looks_ms, (std::vector<std::int64_t>{50, 100, 150, 200, 220}));
  EXPECT_EQ(uplink->ask(mute, 10s, false, [] { return true; }).error().code, ErrorCode::kFailed);
  EXPECT_EQ(time.nowNs() - began_ns, 270'000'000);
  uplink->add(makeSession(1, false), true);  // it does not end by itself
  EXPECT_FALSE(uplink->waitUntilDone(3s));
  EXPECT_EQ(time.nowNs() - began_ns, 3'270'000'000);
}

TEST_F(UplinkTest, aServerThatComesLaterGetsEverything) {
  std::uint16_t port = 0;
  {
    FakeServer gone;
    port = gone.port();
  }
  auto session = makeSession(10, true);
  auto uplink = connected(FakeServer::clientConfig(port));
  uplink->add(session, true);
  ASSERT_TRUE(eventually([&] { return !uplink->state().error.empty(); }));
  EXPECT_FALSE(uplink->state().connected);
  FakeServer server(port);
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  expectWhole(keptOf(server, *session), *session);
  const auto texts = said();
  EXPECT_EQ(std::count_if(texts.begin(), texts.end(),
                          [](const auto& text) { return text.find("trying again") != text.npos; }),
            1)
      << "said once, not at every try";
}

// --- two servers

ClientConfig configOf(const FakeServer& first, std::uint16_t second) {
  ClientConfig config = first.clientConfig();
  config.others = {{"127.0.0.1", second}};
  return config;
}

TEST_F(UplinkTest, theSessionContinuesAtAnotherServerAndPeopleAreTold) {
  std::optional<FakeServer> first(std::in_place);
  FakeServer second;
  auto session = makeSession(3, false);
  auto uplink = connected(configOf(*first, second.port()));
  uplink->add(session, true);
  ASSERT_TRUE(eventually([&] { return uplink->state().current_committed == 3; }));
  const std::string at_first = endpointText(first->clientConfig().server);
  EXPECT_EQ(uplink->state().server, at_first);
  first.reset();
  // for an answer it is worth trying the other server
  const auto lesson = uplink->getLesson("shoulder", "tom", kPatience, true);
  ASSERT_TRUE(lesson.ok()) << lesson.error().message;
  addChunks(*session, 3, 4);
  ASSERT_TRUE(session->end(false).ok());
  uplink->wake();
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  // this one has its own store: the spool sends everything again
  expectWhole(keptOf(second, *session), *session);
  EXPECT_EQ(keptOf(second, *session).repeated, 0u);
  const std::string at_second = endpointText(second.clientConfig().server);
  EXPECT_EQ(uplink->state().server, at_second);
  const std::string all = testing::PrintToString(said());
  EXPECT_THAT(all, HasSubstr("the connection to " + at_first + " is lost"));
  EXPECT_THAT(all, HasSubstr("trying another server"));
  EXPECT_THAT(all, HasSubstr("connected to " + at_second + " as station-1"));
}

TEST_F(UplinkTest, aDeadServerIsPassedOverAndNamed) {
  FakeServer server;
  ClientConfig config = FakeServer::clientConfig(1);
  config.others = {{"127.0.0.1", server.port()}};
  auto uplink = connected(config);
  const auto lesson = uplink->getLesson("shoulder", "tom", kPatience, true);
  ASSERT_TRUE(lesson.ok()) << "asked once: a round is one time";
  ASSERT_EQ(said().size(), 1u);
  EXPECT_THAT(said()[0], HasSubstr("another server did not take us: cannot connect to 127.0.0.1:1: "));
}

TEST_F(UplinkTest, aSessionRefusedForLackOfRoomGoesElsewhere) {
  FakeServer first, second;
  first.faults.no_room = true;
  auto session = makeSession(5, true);
  auto uplink = connected(configOf(first, second.port()));
  uplink->add(session, true);
  ASSERT_TRUE(uplink->waitUntilDone(kPatience));
  expectWhole(keptOf(second, *session), *session);
  EXPECT_EQ(uplink->state().connections, 2u);
  EXPECT_EQ(uplink->state().server_full, "");
}

TEST_F(UplinkTest, aSessionRefusedByAllServersStaysAndIsReported) {
  FakeServer first, second;
  first.faults.no_room = second.faults.no_room = true;
  auto uplink = connected(configOf(first, second.port()));
  uplink->add(makeSession(5, true), true);
  ASSERT_TRUE(eventually([&] { return second.newestStatus().trouble() == "the disk is full"; }));
  const std::uint64_t lines = second.statusLines();
  ASSERT_TRUE(eventually([&] { return second.statusLines() >= lines + 5; }));
  EXPECT_EQ(uplink->state().connections, 2u) << "not to and fro";
  EXPECT_EQ(uplink->state().server_full, "the disk is full");
}

TEST_F(UplinkTest, aRefusedLogInIsReportedAtOnce) {
  FakeServer server;
  server.faults.deny_login = true;
  auto uplink = connected(server.clientConfig());
  auto lesson = uplink->getLesson("shoulder", "tom", kPatience, false);
  ASSERT_FALSE(lesson.ok());
  EXPECT_EQ(lesson.error().code, ErrorCode::kDenied);
  EXPECT_TRUE(uplink->state().denied);
  uplink->add(makeSession(1, true), true);
  EXPECT_FALSE(uplink->waitUntilDone(kPatience)) << "does not wait for a server that says no";
}

TEST_F(UplinkTest, lessonsComeFromTheServerWithItsNoOrNotAtAll) {
  FakeServer server;
  auto uplink = connected(server.clientConfig());
  auto lesson = uplink->getLesson("shoulder", "tom", kPatience, false);
  ASSERT_TRUE(lesson.ok()) << lesson.error().message;
  EXPECT_EQ(lesson->profile_revision(), 7u);
  auto unknown = uplink->getLesson("unknown", "tom", kPatience, false);
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
  auto nobody = connected(FakeServer::clientConfig(1));
  auto away = nobody->getLesson("shoulder", "tom", kPatience, true);
  ASSERT_FALSE(away.ok());
  EXPECT_EQ(away.error().code, ErrorCode::kUnavailable);
}

TEST_F(UplinkTest, aTraineesCodeGoesWithTheRequest) {
  FakeServer server;
  server.setCode("tom", "4711");
  auto uplink = connected(server.clientConfig());
  EXPECT_EQ(uplink->getLesson("shoulder", "tom", kPatience, false).error().code, ErrorCode::kCode);
  EXPECT_EQ(uplink->getLesson("shoulder", "tom", kPatience, false, {}, "0000").error().code,
            ErrorCode::kCode);
  EXPECT_TRUE(uplink->getLesson("shoulder", "tom", kPatience, false, {}, "4711").ok());
  EXPECT_EQ(server.givenCodes(), (std::vector<std::string>{"", "0000", "4711"}));
}

TEST_F(UplinkTest, liveFramesOnlyWhileSomebodyWatches) {
  FakeServer server;
  auto session = makeSession(0, false);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  ASSERT_TRUE(eventually([&] { return keptOf(server, *session).opened == 1; }));
  const auto samples = samplesFrom(0, 20);
  SamplePiece piece{
      std::make_shared<const std::vector<GestureSample>>(samples), samples.back(), 20, 0, {}, {}};
  for (int i = 0; i < 5; ++i) uplink->offer(piece);
  ASSERT_TRUE(eventually([&] { return server.statusLines() >= 2; }));
  EXPECT_EQ(server.liveFrames(), 0u);
  EXPECT_EQ(uplink->state().live_encoded, 0u);
  // the newest piece at once, before the next one exists
  pb::Envelope watch;
  watch.mutable_watch_state()->set_watched(true);
  server.broadcast(watch);
  ASSERT_TRUE(eventually([&] { return server.liveFrames() == 1; }));
  EXPECT_EQ(uplink->state().live_encoded, 1u);
  server.broadcast(watch);
  ASSERT_TRUE(eventually([&] {
    uplink->offer(piece);
    return server.liveFrames() > 5;
  }));
  EXPECT_EQ(server.liveMemories(), 0u);
  piece.cut_memory = Bytes(12, 1);
  uplink->offer(piece);
  piece.cut_memory.clear();
  ASSERT_TRUE(eventually([&] { return server.liveMemories() == 1; }));
  watch.mutable_watch_state()->set_watched(false);
  server.broadcast(watch);
  // messages and status lines keep their order: one sent later arrives later
  pb::Envelope after;
  after.mutable_trainee_message()->set_text("no one looks");
  server.broadcast(after);
  ASSERT_TRUE(eventually([&] {
    const auto texts = said();
    return std::find(texts.begin(), texts.end(), "message no one looks") != texts.end();
  }));
  const auto nextLines = [&] {
    const std::uint64_t lines = server.statusLines();
    return eventually([&] { return server.statusLines() >= lines + 2; });
  };
  ASSERT_TRUE(nextLines());
  const auto before = server.liveFrames();
  const auto encoded_before = uplink->state().live_encoded;
  for (int i = 0; i < 5; ++i) uplink->offer(piece);
  ASSERT_TRUE(nextLines());
  EXPECT_EQ(server.liveFrames(), before);
  EXPECT_EQ(uplink->state().live_encoded, encoded_before);
}

TEST_F(UplinkTest, theClockOffsetIsMeasuredAndReported) {
  FakeServer server;
  auto session = makeSession(0, false);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  ASSERT_TRUE(eventually([&] { return keptOf(server, *session).clock_round_trip_ns > 0; }));
  ASSERT_TRUE(eventually([&] { return uplink->state().clock.has_value(); }));
  // Both clocks are the same: the offset is zero within half the round trip.
  const auto clock = *uplink->state().clock;
  EXPECT_LE(std::abs(clock.offset_ns), clock.round_trip_ns / 2 + 1);
}

TEST_F(UplinkTest, wordsOfInstructorsAreShown) {
  FakeServer server;
  auto uplink = connected(server.clientConfig());
  ASSERT_TRUE(eventually([&] { return uplink->state().connected; }));
  pb::Envelope message, next;
  message.mutable_trainee_message()->set_text("slower");
  next.mutable_next_exercise()->set_exercise_id("knee");
  ASSERT_TRUE(eventually([&] { return server.statusLines() > 0; }));
  server.broadcast(message);
  server.broadcast(next);
  ASSERT_TRUE(eventually([&] { return said().size() >= 3; }));
  EXPECT_THAT(said(), testing::Contains("message slower"));
  EXPECT_THAT(said(), testing::Contains("next knee"));
}

TEST_F(UplinkTest, statusLinesDescribeTheLessonWithinTheirSizeBound) {
  FakeServer server;
  auto session = makeSession(1, false);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  uplink->noteLesson({4.5, {"nerve", "artery"}, 3.0, "muscle"});
  ASSERT_TRUE(eventually([&] { return server.newestStatus().peak_force_n() == 4.5; }));
  pb::StationStatus status = server.newestStatus();
  ASSERT_EQ(status.hazards_touched_size(), 2);
  EXPECT_EQ(status.hazards_touched(0), "nerve");
  EXPECT_EQ(status.force_limit_n(), 3.0);
  EXPECT_EQ(status.tissue(), "muscle");
  EXPECT_EQ(status.started_unix_ns(), session->description().started_unix_ns());
  EXPECT_EQ(status.live_dropped(), 0u);
  EXPECT_EQ(status.layer(), -1) << "before the first sample the needle is outside";
  EXPECT_FALSE(status.hand_raised());
  uplink->noteHand(true);
  ASSERT_TRUE(eventually([&] { return server.newestStatus().hand_raised(); }));

  LessonFacts long_ones{5, {}, 0, std::string(5000, 't')};
  for (int i = 0; i < 100; ++i) long_ones.hazards_touched.push_back(std::string(60, 'h') + std::to_string(i));
  uplink->noteTrouble("device", std::string(5000, 'x'));
  uplink->noteLesson(long_ones);
  ASSERT_TRUE(eventually([&] { return server.newestStatus().peak_force_n() == 5; }));
  ASSERT_TRUE(eventually([&] { return server.newestStatus().trouble().size() == 1024; }));
  status = server.newestStatus();
  EXPECT_GE(status.hazards_touched_size(), 5);
  EXPECT_EQ(status.hazards_touched(0), std::string(60, 'h') + "0");
  EXPECT_LE(status.ByteSizeLong(), 2048u) << "a server refuses more";

  uplink->add(makeSession(1, false), true);
  ASSERT_TRUE(eventually([&] { return server.newestStatus().peak_force_n() == 0; })) << "another lesson";
}

TEST_F(UplinkTest, messagesForAnotherLessonAreIgnored) {
  FakeServer server;
  auto session = makeSession(1, false);
  auto uplink = connected(server.clientConfig());
  uplink->add(session, true);
  ASSERT_TRUE(eventually([&] { return uplink->state().current_committed == 1; }));
  const auto stop = [&](const std::string& id, const std::string& reason) {
    pb::Envelope envelope;
    envelope.mutable_stop_lesson()->set_session_id(id);
    envelope.mutable_stop_lesson()->set_reason(reason);
    server.broadcast(envelope);
  };
  stop(std::string(16, 'x'), "for another lesson");
  stop(session->description().session_id(), "for this one");
  stop("", "for any lesson");
  pb::Envelope aids;
  aids.mutable_set_aids()->set_from("ines");
  aids.mutable_set_aids()->add_aids(pb::Exercise::DEPTH);
  aids.mutable_set_aids()->add_aids(static_cast<pb::Exercise::Aid>(77));  // from a newer server
  aids.mutable_set_aids()->add_aids(pb::Exercise::AID_UNSPECIFIED);
  server.broadcast(aids);
  const auto has = [&](const std::string& text) {
    const auto all = said();
    return std::find(all.begin(), all.end(), text) != all.end();
  };
  ASSERT_TRUE(eventually([&] { return has("aids of ines: 1"); }));
  EXPECT_TRUE(has("stop: for this one"));
  EXPECT_TRUE(has("stop: for any lesson"));
  EXPECT_FALSE(has("stop: for another lesson"));
  EXPECT_THAT(said(), testing::Contains(testing::HasSubstr("was for another lesson and is ignored")));
}

TEST(ClockProbe, theLeastRoundTripWins) {
  ClockProbe probe;
  EXPECT_TRUE(probe.add(1000, 50'500, 2000));   // round trip 1000, offset 49,000
  EXPECT_FALSE(probe.add(3000, 60'000, 9000));  // slower, so less accurate
  EXPECT_TRUE(probe.add(10'000, 59'100, 10'200));
  EXPECT_EQ(probe.best()->offset_ns, 49'000);
  EXPECT_EQ(probe.best()->round_trip_ns, 200);
  EXPECT_FALSE(probe.add(20'000, 0, 19'000)) << "an answer before the question";
}

// --- waiting at the end

class DrainTest : public testing::Test {
 protected:
  DrainTest() {
    spool_ = std::move(*Spool::open(folder_.path()));
    session_ = *spool_->create(describeSession(makeUuidV7()));
    EXPECT_TRUE(session_->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(0, 50)), 50).ok());
    EXPECT_TRUE(session_->sync().ok());
    EXPECT_TRUE(session_->end(false).ok());
  }
  std::unique_ptr<Uplink> uplinkTo(const ClientConfig& client) {
    UplinkConfig config;
    config.client = client;
    config.first_retry = 20ms;
    config.max_retry = 100ms;
    auto uplink = std::make_unique<Uplink>(config, UplinkEvents{});
    uplink->add(session_, true);
    return uplink;
  }
  static DrainEnd drained(Uplink& uplink, const DrainPatience& patience = {.whole = 1h}, bool stop = false) {
    return drain(uplink, patience, [stop] { return stop; });
  }
  static bool connects(const Uplink& uplink) {
    return eventually([&] { return uplink.state().connected; });
  }

  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
  std::shared_ptr<SpoolSession> session_;
};

// When the wait ends, by the second, for each state of the link. The drain begins at 0 s.
TEST(DrainEnd, isDecidedByTheStateAndTheTimesAlone) {
  constexpr std::int64_t kSecond = 1'000'000'000, kBegan = 1'000 * kSecond;
  const DrainPatience patience{10s, 2s, 30s};
  UplinkState connected, new_connecting, new_failed, lost_now, lost_long_ago, denied;
  connected.connected = true;
  connected.connections = 1;
  new_connecting.away_since_ns = new_failed.away_since_ns = kBegan;
  new_failed.error = "no route";
  lost_now.connections = lost_long_ago.connections = 3;
  lost_now.away_since_ns = kBegan - 1 * kSecond;
  lost_long_ago.away_since_ns = kBegan - 40 * kSecond;
  denied.denied = true;
  struct Row {
    const char* what;
    const UplinkState& state;
    DrainPatience patience;
    double ends_s;
    DrainEnd end;
  };
  const std::vector<Row> rows = {
      {"connected, without an end", connected, patience, 10, DrainEnd::kTimeOver},
      {"the first attempt is under way", new_connecting, patience, 10, DrainEnd::kTimeOver},
      {"the first attempt failed", new_failed, patience, 2, DrainEnd::kAway},
      {"lost a second ago", lost_now, patience, 10, DrainEnd::kTimeOver},
      {"lost a second ago, long patience", lost_now, {60s, 2s, 30s}, 29, DrainEnd::kAway},
      {"lost 40 s ago: a second, for it may just be back", lost_long_ago, patience, 1, DrainEnd::kAway},
      {"lost 40 s ago, hardly any patience", lost_long_ago, {0.5s, 2s, 29s}, 0.5, DrainEnd::kTimeOver},
      {"refused", denied, patience, 0, DrainEnd::kDenied},
  };
  for (const Row& row : rows) {
    const auto at = [&](std::int64_t since_ns) {
      return drainEnd(row.state, row.patience, kBegan, kBegan + since_ns);
    };
    const std::int64_t ends_ns = std::llround(row.ends_s * 1e9);
    EXPECT_EQ(at(ends_ns), row.end) << row.what;
    if (ends_ns > 0) {
      EXPECT_EQ(at(ends_ns - 1000), std::nullopt) << row.what;
    }
  }
}

TEST_F(DrainTest, waitsUntilTheServerHasEverything) {
  FakeServer server;
  auto uplink = uplinkTo(server.clientConfig());
  const DrainEnd end = drained(*uplink);
  EXPECT_EQ(end, DrainEnd::kDone);
  EXPECT_TRUE(server.sessions()[session_->description().session_id()].closed);
  EXPECT_EQ(drainText(end, uplink->state()), "");
}

TEST_F(DrainTest, aDrainWithoutAnyServerDoesNotWaitTheFullTime) {
  auto uplink = uplinkTo(FakeServer::clientConfig(1));
  const DrainEnd end = drained(*uplink, {1h, 0s, 1h});
  EXPECT_EQ(end, DrainEnd::kAway);
  EXPECT_THAT(drainText(end, uplink->state()),
              AllOf(HasSubstr("not connected"), HasSubstr("keeps everything")));
}

TEST_F(DrainTest, whatWasConnectedAMomentAgoIsWaitedFor) {
  auto server = std::make_unique<FakeServer>();
  const auto port = server->port();
  server->faults.never_ack = true;
  auto uplink = uplinkTo(server->clientConfig());
  ASSERT_TRUE(connects(*uplink));
  server.reset();
  // The server comes back once the drain has noticed that it is away.
  const auto comeBack = [&] {
    if (!server && !uplink->state().connected) server = std::make_unique<FakeServer>(port);
    return false;
  };
  EXPECT_EQ(drain(*uplink, {1h, 0s, 1h}, comeBack), DrainEnd::kDone);
  EXPECT_TRUE(server);
}

TEST_F(DrainTest, endsInTimeByACallersWordAndByTheServersNo) {
  FakeServer server;
  server.faults.never_ack = true;
  auto uplink = uplinkTo(server.clientConfig());
  ASSERT_TRUE(connects(*uplink));
  const DrainEnd end = drained(*uplink, {100ms, 1h, 1h});
  EXPECT_EQ(end, DrainEnd::kTimeOver);
  EXPECT_THAT(drainText(end, uplink->state()), HasSubstr("1 chunks could not be sent"));
  EXPECT_EQ(drained(*uplink, {.whole = 1h}, true), DrainEnd::kStopped);
  uplink.reset();
  server.faults.deny_login = true;
  auto denied = uplinkTo(server.clientConfig());
  EXPECT_EQ(drained(*denied), DrainEnd::kDenied);
}

}  // namespace
}  // namespace needlelab::test
