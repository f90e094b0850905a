// Messages from people to stations at another server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "common/wire/protocol.h"
#include "server/base/log.h"
#include "server/together/remote_live.h"
#include "tests/unit/db/planted_here.h"
#include "tests/unit/server/together/live_bus.h"

namespace needlelab {
namespace {

using test::LiveLab;
using test::LiveMessage;
using test::LiveServer;
using test::RecordingPeer;
using testing::HasSubstr;
using Kind = RemoteLive::Asked::Kind;

pb::Envelope stopAt(const std::string& station) {
  pb::Envelope stop;
  stop.mutable_stop_lesson()->set_station(station);
  stop.mutable_stop_lesson()->set_from("ines");
  stop.mutable_stop_lesson()->set_reason("enough");
  return stop;
}

class RemoteAsksTest : public testing::Test {
 protected:
  RemoteAsksTest() {
    setLogLevel(LogLevel::kOff);
    for (LiveServer* const server : {&a, &b, &c}) deliverAt(*server);
  }
  ~RemoteAsksTest() override { test::bugPlantedHere().reset(); }
  void TearDown() override {
    for (const auto& server : lab.servers)
      for (RecordingPeer* const peer : {&at_a, &at_b}) server->hub.detachStation("bench-1", *peer);
  }
  /// Acts as a server: passes messages to the station's connection, which confirms them at once.
  void deliverAt(LiveServer& server) {
    server.remote->deliverBy(
        [&server](const std::string& station, const pb::Envelope& message, RemoteLive::DeliverDone done) {
          HubPeer* const peer = server.hub.stationPeer(station);
          if (peer == nullptr) return done(makeRefusal(pb::Refusal::NOT_FOUND, "not online"));
          peer->sendControl(message);
          done(std::nullopt);
        });
  }
  void ask(LiveServer& server, const pb::Envelope& message) {
    answer.reset();
    answers = 0;
    server.remote->ask("bench-1", message, [this](RemoteLive::Asked asked) {
      answer = std::move(asked);
      ++answers;
    });
  }
  static std::size_t stops(const RecordingPeer& station) {
    return static_cast<std::size_t>(std::count_if(station.control.begin(), station.control.end(),
                                                  [](const auto& each) { return each.has_stop_lesson(); }));
  }
  void expectAnswer(Kind kind) {
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->kind, kind) << answer->refusal.text();
    EXPECT_EQ(answers, 1);
  }

  LiveLab lab;
  LiveServer& a = lab.add("a");
  LiveServer& b = lab.add("b");
  LiveServer& c = lab.add("c");
  RecordingPeer at_a, at_b;
  std::optional<RemoteLive::Asked> answer;
  int answers = 0;
};

TEST_F(RemoteAsksTest, reachTheStationAtItsServer) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  ASSERT_TRUE(c.remote->isRemote("bench-1"));
  ASSERT_FALSE(a.remote->isRemote("bench-1"));
  pb::Envelope text, next, aids;
  text.mutable_trainee_message()->set_station("bench-1");
  text.mutable_trainee_message()->set_from("ines");
  text.mutable_trainee_message()->set_text("slower");
  next.mutable_next_exercise()->set_station("bench-1");
  next.mutable_next_exercise()->set_from("ines");
  next.mutable_next_exercise()->set_exercise_id("knee");
  aids.mutable_set_aids()->set_station("bench-1");
  aids.mutable_set_aids()->set_from("ines");
  aids.mutable_set_aids()->set_reset(true);
  for (const pb::Envelope& message : {text, next, aids, stopAt("bench-1")}) {
    ask(c, message);
    EXPECT_FALSE(answer);
    lab.bus.deliver();
    expectAnswer(Kind::kDelivered);
    EXPECT_EQ(at_a.control.back().SerializeAsString(), message.SerializeAsString());
  }
  EXPECT_EQ(c.remote->counters().asked, 4u);
  EXPECT_EQ(a.remote->counters().asked_here, 4u);
}

TEST_F(RemoteAsksTest, areRefusedInTheWordsOfTheServerThatHasTheStation) {
  a.hub.attachStation("bench-1", at_a, 5);
  a.remote->deliverBy([](const auto&, const auto&, RemoteLive::DeliverDone done) {
    done(makeRefusal(pb::Refusal::VERSION, "bring the station up to date"));
  });
  lab.run(200);
  ask(c, stopAt("bench-1"));
  lab.bus.deliver();
  expectAnswer(Kind::kRefused);
  EXPECT_EQ(answer->refusal.reason(), pb::Refusal::VERSION);
  EXPECT_EQ(answer->refusal.text(), "bring the station up to date");
}

TEST_F(RemoteAsksTest, ofAnUnconnectedStationAreRefusedAtOnce) {
  lab.run(200);
  ask(c, stopAt("bench-1"));
  expectAnswer(Kind::kRefused);
  EXPECT_EQ(answer->refusal.reason(), pb::Refusal::NOT_FOUND);
  c.hub.attachStation("bench-1", at_a);
  ask(c, stopAt("bench-1"));
  expectAnswer(Kind::kLocal);
}

TEST_F(RemoteAsksTest, comeOnceHoweverOftenTheyArrive) {
  lab.bus.twice = true;
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  ask(c, stopAt("bench-1"));
  lab.bus.deliver();
  expectAnswer(Kind::kDelivered);
  EXPECT_EQ(stops(at_a), 1u);
}

/// The station moved from a to b, and c does not know: c asks a. Returns whether the stop reached only b's
/// connection.
bool stopReachesTheOneThatTookOver(LiveLab& lab, LiveServer& a, LiveServer& b, LiveServer& c,
                                   RecordingPeer& at_a, RecordingPeer& at_b) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  lab.bus.loses = [](const LiveMessage& message, const std::string& to) {
    return message.plane == LivePlane::kPresence && to == "c";
  };
  b.hub.attachStation("bench-1", at_b, 6);
  lab.run(150);
  EXPECT_EQ(c.listed("bench-1").status().server(), "a") << "this is what c knows";
  std::optional<RemoteLive::Asked> answer;
  c.remote->ask("bench-1", stopAt("bench-1"), [&](RemoteLive::Asked asked) { answer = std::move(asked); });
  lab.run(500);
  const auto stops = [](const RecordingPeer& station) {
    return std::count_if(station.control.begin(), station.control.end(),
                         [](const auto& each) { return each.has_stop_lesson(); });
  };
  return answer && answer->kind == Kind::kDelivered && stops(at_a) == 0 && stops(at_b) == 1;
}

TEST_F(RemoteAsksTest, areAskedAgainOfTheServerThatTookTheStationOver) {
  EXPECT_TRUE(stopReachesTheOneThatTookOver(lab, a, b, c, at_a, at_b));
  EXPECT_EQ(c.remote->counters().not_here, 1u);
  EXPECT_EQ(c.remote->counters().asked, 2u);
}

TEST_F(RemoteAsksTest, aStopToTheWrongStationAfterATakeoverIsCaught) {
  test::bugPlantedHere() = PlantedBug::kEpochIgnored;
  EXPECT_FALSE(stopReachesTheOneThatTookOver(lab, a, b, c, at_a, at_b));
}

TEST_F(RemoteAsksTest, thatKnowANewerConnectionDoNotReachTheOldOne) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  // a hears nothing from b: it believes that it has the station
  lab.bus.loses = [](const LiveMessage& message, const std::string& to) {
    return message.from == "b" && to == "a";
  };
  b.hub.attachStation("bench-1", at_b, 6);
  lab.run(150);
  pb::StationAsk wrong;
  wrong.mutable_origin()->set_lab("lab");
  wrong.mutable_origin()->set_server("z");
  wrong.mutable_origin()->set_instance(9);
  wrong.mutable_origin()->set_number(1);
  wrong.set_server("a");
  wrong.set_station("bench-1");
  wrong.set_epoch(6);
  *wrong.mutable_stop_lesson() = stopAt("bench-1").stop_lesson();
  a.remote->onMessage(LivePlane::kAsk, "bench-1", wrong.SerializeAsString());
  EXPECT_EQ(stops(at_a), 0u);
  // c knows better, and nothing is sent to a
  ask(c, stopAt("bench-1"));
  lab.bus.deliver();
  expectAnswer(Kind::kDelivered);
  EXPECT_EQ(stops(at_a), 0u);
  EXPECT_EQ(stops(at_b), 1u);
}

TEST_F(RemoteAsksTest, areRepeatedWhenTheLostStationAppearsElsewhere) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  lab.bus.loses = [](const LiveMessage& message, const std::string&) {
    return message.plane == LivePlane::kPresence;
  };
  a.hub.detachStation("bench-1", at_a);
  lab.run(150);
  ask(c, stopAt("bench-1"));
  lab.run(300);
  EXPECT_FALSE(answer) << "a has it no more; c waits for news";
  lab.bus.loses = nullptr;
  b.hub.attachStation("bench-1", at_b, 6);
  lab.run(300);
  expectAnswer(Kind::kDelivered);
  EXPECT_EQ(stops(at_b), 1u);
}

TEST_F(RemoteAsksTest, whoseStationIsGoneForGoodAreRefused) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  ask(c, stopAt("bench-1"));
  a.hub.detachStation("bench-1", at_a);
  lab.bus.deliver();
  EXPECT_FALSE(answer);
  lab.run(2200);
  expectAnswer(Kind::kRefused);
  EXPECT_EQ(answer->refusal.reason(), pb::Refusal::NOT_FOUND);
  EXPECT_THAT(answer->refusal.text(), HasSubstr("not online"));
}

TEST_F(RemoteAsksTest, areDeliveredLocallyWhenTheStationArrives) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  ask(c, stopAt("bench-1"));
  a.hub.detachStation("bench-1", at_a);
  lab.bus.deliver();
  c.hub.attachStation("bench-1", at_b, 6);
  lab.run(50);
  expectAnswer(Kind::kLocal);
  EXPECT_EQ(stops(at_b), 0u) << "the caller delivers it";
}

TEST_F(RemoteAsksTest, withoutAnAnswerMayNotHaveArrived) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  lab.bus.loses = [](const LiveMessage& message, const std::string&) {
    return message.plane == LivePlane::kAnswer;
  };
  ask(c, stopAt("bench-1"));
  lab.run(7900);
  EXPECT_FALSE(answer);
  lab.run(200);
  expectAnswer(Kind::kRefused);
  EXPECT_EQ(answer->refusal.reason(), pb::Refusal::TIMEOUT);
  EXPECT_THAT(answer->refusal.text(), HasSubstr("may not have arrived"));
  EXPECT_EQ(stops(at_a), 1u) << "it is never sent twice";
}

TEST_F(RemoteAsksTest, withoutTheLinkAreRefusedAndPendingOnesUncertain) {
  a.hub.attachStation("bench-1", at_a, 5);
  a.remote->deliverBy([](const auto&, const auto&, const auto&) {});  // the station does not confirm
  lab.run(200);
  ask(c, stopAt("bench-1"));
  lab.bus.deliver();
  EXPECT_FALSE(answer);
  c.disconnect();
  expectAnswer(Kind::kRefused);
  EXPECT_THAT(answer->refusal.text(), HasSubstr("may not have arrived"));
  ask(c, stopAt("bench-1"));
  expectAnswer(Kind::kRefused);
  EXPECT_THAT(answer->refusal.text(), HasSubstr("nothing was sent"));
  EXPECT_THAT(answer->refusal.text(), HasSubstr("server 'a'"));
}

TEST_F(RemoteAsksTest, areEndedByAServerThatStops) {
  a.hub.attachStation("bench-1", at_a, 5);
  a.remote->deliverBy([](const auto&, const auto&, const auto&) {});
  lab.run(200);
  ask(c, stopAt("bench-1"));
  lab.bus.deliver();
  c.remote->leave();
  expectAnswer(Kind::kRefused);
  EXPECT_EQ(answer->refusal.reason(), pb::Refusal::SHUTTING_DOWN);
}

TEST_F(RemoteAsksTest, withWhatNoServerWouldSendAreNotDelivered) {
  a.hub.attachStation("bench-1", at_a, 5);
  lab.run(200);
  at_a.control.clear();
  std::uint64_t number = 1'000'000;
  const auto send = [&](pb::StationAsk ask) {
    ask.mutable_origin()->set_lab("lab");
    ask.mutable_origin()->set_server("z");
    ask.mutable_origin()->set_instance(9);
    ask.mutable_origin()->set_number(++number);
    ask.set_server("a");
    ask.set_station("bench-1");
    a.remote->onMessage(LivePlane::kAsk, "bench-1", ask.SerializeAsString());
  };
  pb::StationAsk ask;
  send(ask);  // no message
  *ask.mutable_stop_lesson() = stopAt("bench-2").stop_lesson();
  send(ask);  // another station
  *ask.mutable_stop_lesson() = stopAt("bench-1").stop_lesson();
  ask.mutable_stop_lesson()->clear_from();
  send(ask);
  ask.mutable_stop_lesson()->set_from("ines");
  ask.mutable_stop_lesson()->set_reason(std::string(5000, 'x'));
  send(ask);
  ask.mutable_stop_lesson()->clear_reason();
  ask.mutable_stop_lesson()->set_session_id("short");
  send(ask);
  ask.mutable_trainee_message()->set_station("bench-1");
  ask.mutable_trainee_message()->set_from("ines");
  send(ask);  // no text
  ask.mutable_set_aids()->set_station("bench-1");
  ask.mutable_set_aids()->set_from("ines");
  for (int i = 0; i < 65; ++i) ask.mutable_set_aids()->add_aids(pb::Exercise::AID_UNSPECIFIED);
  send(ask);
  EXPECT_TRUE(at_a.control.empty());
  EXPECT_EQ(a.remote->counters().malformed, 7u);
  *ask.mutable_stop_lesson() = stopAt("bench-1").stop_lesson();
  send(ask);
  EXPECT_EQ(stops(at_a), 1u);
}

}  // namespace
}  // namespace needlelab
