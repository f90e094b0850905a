#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/wire/protocol.h"
#include "tests/support/patience.h"
#include "tests/unit/server/live/raw_peer.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

struct Lab {
  RunningServer server;
  BlockingClient station = std::move(*server.connect(stationLogin("bench-1", server.addStation("bench-1"))));
  BlockingClient instructor = [this] {
    server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
    return std::move(*server.connect(personLogin("anna", "correct horse battery")));
  }();
};

TEST(ConnectionRequests, aStatusNamesTheStoredTraineeEvenAfterARestart) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  server.addUser("tina", pb::TRAINEE, "");
  const FakeSession session("bench-1");
  std::uint64_t said = 0;
  const auto shown = [&](BlockingClient& station, BlockingClient& instructor, const std::string& id,
                         const std::string& trainee) -> std::string {
    pb::Envelope status;
    status.mutable_station_status()->set_session_id(id);
    status.mutable_station_status()->set_trainee(trainee);
    status.mutable_station_status()->set_samples(++said);
    EXPECT_TRUE(station.send(status).ok());
    pb::Request list;
    list.mutable_list_stations();
    for (int i = 0; i < 500; ++i) {
      (void)station.receive(milliseconds(20));  // it sends while it waits
      const auto reply = instructor.call(list);
      if (!reply.ok()) break;
      const pb::StationStatus& now = reply->stations().stations(0).status();
      if (now.samples() == said) return now.trainee();
    }
    return "(the status did not come)";
  };
  const auto open = [&](BlockingClient& station) {
    EXPECT_TRUE(station.send(session.open()).ok());
    (void)waitFor(station, [](const pb::Envelope& e) { return e.has_session_opened(); });
  };
  {
    BlockingClient station = std::move(*server.connect(stationLogin("bench-1", key)));
    BlockingClient anna = std::move(*server.connect(personLogin("anna", "correct horse battery")));
    EXPECT_EQ(shown(station, anna, "", "tina"), "");
    EXPECT_EQ(shown(station, anna, session.id(), "tina"), "") << "not opened yet";
    open(station);
    EXPECT_EQ(shown(station, anna, session.id(), "tina"), "tina");
    EXPECT_EQ(shown(station, anna, session.id(), "tom"), "tina") << "not what the station says";
  }
  pb::Request erase;
  erase.mutable_erase_person()->set_name("tina");
  erase.mutable_erase_person()->set_confirm("tina");
  erase.mutable_erase_person()->set_with_open_sessions(true);
  server.asAdmin(erase);
  EXPECT_EQ(server.restart(), 0);
  // the station continues its lesson
  BlockingClient station = std::move(*server.connect(stationLogin("bench-1", key)));
  BlockingClient anna = std::move(*server.connect(personLogin("anna", "correct horse battery")));
  open(station);
  EXPECT_EQ(shown(station, anna, session.id(), "tina"), "");
}

TEST(ConnectionRequests, aLessonBeginsWithTheTraineesCodeOnly) {
  Lab lab;
  lab.server.addUser("tom", pb::TRAINEE, "");
  pb::Request set, lesson;
  set.mutable_set_code()->set_name("tom");
  set.mutable_set_code()->set_make(true);
  const std::string pin = lab.server.asAdmin(set).new_code().code();
  ASSERT_EQ(pin.size(), 6u);
  lesson.mutable_get_lesson()->set_exercise_id("ball-free-practice");
  lesson.mutable_get_lesson()->set_trainee("tom");
  for (const std::string& wrong : {std::string(), pin + "0"}) {
    lesson.mutable_get_lesson()->set_code(wrong);
    const auto refused = lab.station.call(lesson);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kCode) << refused.error().message;
    EXPECT_THAT(refused.error().message,
                HasSubstr(wrong.empty() ? "tom has a code" : "this is not the code of tom; 4 tries left"));
  }
  lesson.mutable_get_lesson()->set_code(pin);
  const auto begun = lab.station.call(lesson);
  ASSERT_TRUE(begun.ok()) << begun.error().message;
  EXPECT_TRUE(begun->has_lesson());
}

// The finding: a trainee set 96 new codes, and no one could log in.
TEST(ConnectionRequests, aPersonsNewCodesWaitEightAtATimeOverAllConnections) {
  const char* const password = "correct horse battery";
  RunningServer server;
  server.addUser("tom", pb::TRAINEE, password);
  server.addUser("ines", pb::INSTRUCTOR, password);
  RawPeer peers[] = {RawPeer(server), RawPeer(server), RawPeer(server)};
  for (RawPeer& peer : peers) ASSERT_TRUE(peer.logIn(personLogin("tom", password)).has_welcome());
  // The first code waits for the writer, so none completes and frees a place.
  std::promise<void> go;
  const auto held = [gone = go.get_future().share()](Connection&) -> Status {
    gone.wait();
    return {};
  };
  ASSERT_TRUE(server.server().store().writer().post(held, {}).ok());
  int done = 0;
  std::vector<pb::Refusal> refusals;
  const auto count = [&](const pb::Envelope& got) {
    done += got.has_reply() ? 1 : 0;
    if (got.has_refusal()) refusals.push_back(got.refusal());
  };
  for (RawPeer& peer : peers) {
    pb::Envelope code, ping;
    code.mutable_request()->mutable_set_code()->set_name("tom");
    code.mutable_request()->mutable_set_code()->set_code("1234");
    for (std::uint64_t id = 1; id <= 7; ++id) {  // one fewer than stops reading from this connection
      code.mutable_request()->set_id(id);
      peer.send(code);
    }
    ping.mutable_ping()->set_id(1);
    peer.send(ping);
    bool read = false;
    while (!read) {
      const auto got = peer.receive();
      ASSERT_TRUE(got.has_value());
      read = got->has_pong() && got->pong().id() == 1;
      count(*got);
    }
  }
  const auto readSome = [&] {
    for (RawPeer& peer : peers)
      if (const auto got = peer.receive(milliseconds(1))) count(*got);
  };
  for (int tries = 0; refusals.size() < 12 && tries < 20'000; ++tries) readSome();
  EXPECT_EQ(done, 0);
  EXPECT_GE(refusals.size(), 12u) << "of 21, one at work and eight waiting";
  go.set_value();
  EXPECT_TRUE(RawPeer(server).logIn(personLogin("ines", password)).has_welcome());
  for (RawPeer& peer : peers) {
    pb::Envelope last;
    last.mutable_request()->set_id(8);
    last.mutable_request()->mutable_get_user()->set_name("tom");
    peer.send(last);
  }
  for (int tries = 0; done + static_cast<int>(refusals.size()) < 3 * 8 && tries < 20'000; ++tries) readSome();
  const int codes = done - 3;
  EXPECT_TRUE(codes == 8 || codes == 9) << codes << ": those that wait, and perhaps the one at work";
  for (const pb::Refusal& refusal : refusals)
    EXPECT_THAT(refusal.text(), HasSubstr("8 passwords and codes of this account wait"));
}

TEST(ConnectionRequests, aMessageReachesTheTraineeAndNamesItsSender) {
  Lab lab;
  pb::Request request;
  request.mutable_trainee_message()->set_station("bench-1");
  request.mutable_trainee_message()->set_from("the dean");
  request.mutable_trainee_message()->set_text("slower, please");
  // The reply confirms that the station has read it, so the station must read in the meantime.
  pb::TraineeMessage got;
  std::thread station([&] {
    got =
        waitFor(lab.station, [](const pb::Envelope& e) { return e.has_trainee_message(); }).trainee_message();
    (void)lab.station.receive(milliseconds(100));  // answers the following Ping
  });
  EXPECT_TRUE(lab.instructor.call(request).ok());
  station.join();
  EXPECT_EQ(got.text(), "slower, please");
  EXPECT_EQ(got.from(), "anna");
  request.mutable_trainee_message()->set_station("bench-9");
  const auto refused = lab.instructor.call(request);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
}

TEST(ConnectionRequests, aidsAndStopsReachTheStationWithTheSendersName) {
  Lab lab;
  pb::Request aids, stop;
  aids.mutable_set_aids()->set_station("bench-1");
  aids.mutable_set_aids()->set_from("the dean");
  aids.mutable_set_aids()->add_aids(pb::Exercise::ULTRASOUND);
  stop.mutable_stop_lesson()->set_station("bench-1");
  stop.mutable_stop_lesson()->set_reason("enough for today");
  pb::SetAids set;
  pb::StopLesson ended;
  std::thread station([&] {
    set = waitFor(lab.station, [](const pb::Envelope& e) { return e.has_set_aids(); }).set_aids();
    ended = waitFor(lab.station, [](const pb::Envelope& e) { return e.has_stop_lesson(); }).stop_lesson();
    (void)lab.station.receive(milliseconds(100));  // answers the following Ping
  });
  EXPECT_TRUE(lab.instructor.call(aids).ok());
  EXPECT_TRUE(lab.instructor.call(stop).ok());
  station.join();
  EXPECT_EQ(set.from(), "anna");
  ASSERT_EQ(set.aids_size(), 1);
  EXPECT_EQ(set.aids(0), pb::Exercise::ULTRASOUND);
  EXPECT_EQ(ended.from(), "anna");
  EXPECT_EQ(ended.reason(), "enough for today");
}

std::vector<pb::AuditEntry> auditLines(RunningServer& server, const std::string& action) {
  pb::Request list;
  list.mutable_list_audit()->set_action(action);
  const pb::Reply reply = server.asAdmin(list);
  return {reply.audit().entries().begin(), reply.audit().entries().end()};
}

TEST(ConnectionRequests, anUndeliveredMessageIsReportedAndAudited) {
  Lab lab;
  lab.server.addStation("bench-2");
  pb::Request stop;
  stop.mutable_stop_lesson()->set_station("bench-2");
  stop.mutable_stop_lesson()->set_reason("enough");
  const auto refused = lab.instructor.call(stop);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
  // The second line is written at the same time as the answer.
  std::vector<pb::AuditEntry> lines;
  (void)eventually([&] { return !(lines = auditLines(lab.server, "not delivered")).empty(); });
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].who(), "anna");
  EXPECT_EQ(lines[0].subject(), "bench-2");
  EXPECT_THAT(lines[0].detail(), HasSubstr("stop: station 'bench-2' is not online"));
  lines = auditLines(lab.server, "stop");
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].detail(), "enough");
}

// The finding: six such lines had the name of a person erased five seconds earlier.
TEST(ConnectionRequests, anUndeliveredMessageIsAuditedUnderALaterPseudonym) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  auto station = std::make_unique<RawPeer>(server);
  ASSERT_TRUE(station->logIn(stationLogin("bench-1", server.addStation("bench-1"))).has_welcome());
  RawPeer instructor(server);
  ASSERT_TRUE(instructor.logIn(personLogin("anna", "correct horse battery")).has_welcome());
  pb::Envelope stop;
  stop.mutable_request()->set_id(1);
  stop.mutable_request()->mutable_stop_lesson()->set_station("bench-1");
  instructor.send(stop);
  // the station receives it and does not confirm
  for (bool heard = false; !heard;) {
    const auto got = station->receive();
    ASSERT_TRUE(got.has_value());
    heard = got->has_stop_lesson();
  }
  pb::Request erase;
  erase.mutable_erase_person()->set_name("anna");
  erase.mutable_erase_person()->set_confirm("anna");
  const std::string pseudonym = server.asAdmin(erase).erasure().pseudonym();
  station.reset();
  std::vector<pb::AuditEntry> lines;
  (void)eventually([&] { return !(lines = auditLines(server, "not delivered")).empty(); });
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].who(), pseudonym);
  for (const auto& line : auditLines(server, ""))
    EXPECT_THAT(line.ShortDebugString(), testing::Not(HasSubstr("anna")));
}

TEST(ConnectionRequests, aForbiddenRequestIsRefusedAndTheConnectionContinues) {
  Lab lab;
  pb::Request add;
  add.mutable_add_user()->set_name("mallory");
  add.mutable_add_user()->set_role(pb::ADMINISTRATOR);
  for (BlockingClient* client : {&lab.instructor, &lab.station}) {
    const auto refused = client->call(add);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kDenied) << refused.error().message;
    EXPECT_TRUE(client->connected());
  }
}

TEST(ConnectionRequests, aRequestWithoutACallIsInvalid) {
  Lab lab;
  const auto refused = lab.instructor.call(pb::Request{});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
}

TEST(LivePlane, framesReachTheViewerOverTheWire) {
  Lab lab;
  pb::Envelope subscribe;
  subscribe.mutable_subscribe()->set_subscription(1);
  subscribe.mutable_subscribe()->set_station("bench-1");
  ASSERT_TRUE(lab.instructor.send(subscribe).ok());
  (void)waitFor(lab.instructor, [](const pb::Envelope& e) { return e.has_subscribed(); });
  EXPECT_TRUE(waitFor(lab.station, [](const pb::Envelope& e) { return e.has_watch_state(); })
                  .watch_state()
                  .watched());
  for (std::uint64_t n = 0; n < 20; ++n) {
    pb::Envelope frame;
    frame.mutable_live_frame()->set_frame_seq(n);
    frame.mutable_live_frame()->set_data("n" + std::to_string(n));
    ASSERT_TRUE(lab.station.send(frame).ok());
  }
  (void)lab.station.receive(milliseconds(50));
  for (std::uint64_t n = 0; n < 20; ++n) {
    const auto got =
        waitFor(lab.instructor, [](const pb::Envelope& e) { return e.has_live_frame(); }).live_frame();
    EXPECT_EQ(got.frame_seq(), n);
    EXPECT_EQ(got.station(), "bench-1");
  }
  lab.instructor.finish();
  EXPECT_FALSE(waitFor(lab.station, [](const pb::Envelope& e) { return e.has_watch_state(); })
                   .watch_state()
                   .watched());
}

TEST(LivePlane, aViewerThatDoesNotReadHoldsUpNeitherStoreNorOthers) {
  Lab lab;
  lab.server.addUser("slow", pb::INSTRUCTOR, "correct horse battery");
  auto config = lab.server.config(personLogin("slow", "correct horse battery"));
  config.limits.socket_buffer_bytes = 128 << 10;
  auto slow = BlockingClient::connect(config);
  ASSERT_TRUE(slow.ok());
  pb::Envelope subscribe;
  subscribe.mutable_subscribe()->set_subscription(1);
  subscribe.mutable_subscribe()->set_station("bench-1");
  for (BlockingClient* client : {&*slow, &lab.instructor}) {
    ASSERT_TRUE(client->send(subscribe).ok());
    (void)waitFor(*client, [](const pb::Envelope& e) { return e.has_subscribed(); });
  }
  // From here on `slow` does not read, so its socket fills up. 20 MB of frames, with chunks between them.
  FakeSession session("bench-1");
  ASSERT_TRUE(lab.station.send(session.open()).ok());
  const auto sendFrame = [&](std::uint64_t n) {
    pb::Envelope frame;
    frame.mutable_live_frame()->set_frame_seq(n);
    frame.mutable_live_frame()->set_data(std::string(50'000, 'x'));
    EXPECT_TRUE(lab.station.send(frame).ok());
  };
  std::uint64_t got = 0, slow_got = 0, next = 0;
  while (next < 400) {
    sendFrame(next);
    if (next % 40 == 0) {
      ASSERT_TRUE(lab.station.send(session.chunk(next / 40)).ok());
      session.waitForAck(lab.station, next / 40 + 1);
    } else {
      (void)lab.station.receive(milliseconds(1));
    }
    ++next;
    for (;;) {
      const auto envelope = lab.instructor.receive(milliseconds(0));
      if (!envelope.ok()) break;
      got += envelope->has_live_frame() ? 1u : 0u;
    }
  }
  // A viewer's first frame from number 400 on; counts those before it; sends more until one arrives.
  const auto newest = [&](BlockingClient& viewer, std::uint64_t& count) -> pb::LiveFrame {
    for (;;) {
      sendFrame(next++);
      (void)lab.station.receive(milliseconds(1));
      auto envelope = viewer.receive(milliseconds(20));
      for (; envelope.ok(); envelope = viewer.receive(milliseconds(20))) {
        if (!envelope->has_live_frame()) continue;
        if (envelope->live_frame().frame_seq() >= 400) return envelope->live_frame();
        ++count;
      }
      if (envelope.error().code == ErrorCode::kNotFound) continue;
      ADD_FAILURE() << envelope.error().message;
      return {};
    }
  };
  // The slow viewer wakes up: it gets the newest frames and is told about its loss.
  for (const auto& [viewer, count] : {std::pair{&lab.instructor, &got}, {&*slow, &slow_got}}) {
    const pb::LiveFrame last = newest(*viewer, *count);
    EXPECT_EQ(*count + last.dropped_for_you(), last.frame_seq()) << "every frame is either there or counted";
  }
  EXPECT_GT(got, 350u) << "the fast viewer gets (nearly) all";
  EXPECT_LT(slow_got, 400u);
}

}  // namespace
}  // namespace needlelab
