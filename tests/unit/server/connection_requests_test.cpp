#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "running_server.h"

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

TEST(Requests, stationsAreListedWithTheirStateNow) {
  Lab lab;
  lab.server.addStation("bench-2");
  pb::Envelope status;
  status.mutable_station_status()->set_trainee("tina");
  ASSERT_TRUE(lab.station.send(status).ok());
  (void)lab.station.receive(milliseconds(100));
  pb::Request list;
  list.mutable_list_stations();
  const auto reply = lab.instructor.call(list);
  ASSERT_TRUE(reply.ok()) << reply.error().message;
  ASSERT_EQ(reply->stations().stations_size(), 2);
  EXPECT_TRUE(reply->stations().stations(0).online());
  EXPECT_EQ(reply->stations().stations(0).status().trainee(), "tina");
  EXPECT_FALSE(reply->stations().stations(1).online());
}

TEST(Requests, aMessageReachesTheTraineeAndNamesItsSender) {
  Lab lab;
  pb::Request request;
  request.mutable_trainee_message()->set_station("bench-1");
  request.mutable_trainee_message()->set_from("the dean");
  request.mutable_trainee_message()->set_text("slower, please");
  // the reply says that the station has read it, so somebody must read there meanwhile
  pb::TraineeMessage got;
  std::thread station([&] {
    got =
        waitFor(lab.station, [](const pb::Envelope& e) { return e.has_trainee_message(); }).trainee_message();
    (void)lab.station.receive(milliseconds(100));  // answers the Ping behind it
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

TEST(Requests, whatARoleMayNotDoIsRefusedAndTheConnectionGoesOn) {
  Lab lab;
  pb::Request add;
  add.mutable_add_user()->set_name("mallory");
  add.mutable_add_user()->set_role(pb::ADMINISTRATOR);
  for (BlockingClient* client : {&lab.instructor, &lab.station}) {
    const auto refused = client->call(add);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kDenied) << refused.error().message;
    pb::Request lesson;
    lesson.mutable_list_curricula();
    EXPECT_TRUE(client->connected());
  }
}

TEST(Requests, aRequestWithoutACallIsInvalid) {
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
  // from here on `slow` is not run: its socket fills. 20 MB of frames, and chunks between them
  FakeSession session("bench-1");
  ASSERT_TRUE(lab.station.send(session.open()).ok());
  std::uint64_t got = 0;
  for (std::uint64_t n = 0; n < 400; ++n) {
    pb::Envelope frame;
    frame.mutable_live_frame()->set_frame_seq(n);
    frame.mutable_live_frame()->set_data(std::string(50'000, 'x'));
    ASSERT_TRUE(lab.station.send(frame).ok());
    if (n % 40 == 0) {
      ASSERT_TRUE(lab.station.send(session.chunk(n / 40)).ok());
      session.waitForAck(lab.station, n / 40 + 1);
    } else {
      (void)lab.station.receive(milliseconds(1));
    }
    for (;;) {
      const auto envelope = lab.instructor.receive(milliseconds(0));
      if (!envelope.ok()) break;
      got += envelope->has_live_frame() ? 1u : 0u;
    }
  }
  while (got < 400) {
    const auto envelope = lab.instructor.receive(milliseconds(1000));
    if (!envelope.ok()) break;
    got += envelope->has_live_frame() ? 1u : 0u;
  }
  EXPECT_GT(got, 350u) << "the fast viewer gets (nearly) all";
  // the slow one wakes up: it gets the newest, and hears of its loss
  std::uint64_t dropped = 0, slow_got = 0;
  for (;;) {
    const auto envelope = slow->receive(milliseconds(1000));
    if (!envelope.ok()) break;
    if (!envelope->has_live_frame()) continue;
    ++slow_got;
    dropped = std::max(dropped, envelope->live_frame().dropped_for_you());
  }
  EXPECT_LT(slow_got, 400u);
  pb::Envelope frame;
  frame.mutable_live_frame()->set_frame_seq(400);
  ASSERT_TRUE(lab.station.send(frame).ok());
  (void)lab.station.receive(milliseconds(50));
  const auto last = waitFor(*slow, [](const pb::Envelope& e) { return e.has_live_frame(); }).live_frame();
  EXPECT_EQ(last.frame_seq(), 400u);
  EXPECT_EQ(slow_got + last.dropped_for_you(), 400u) << "every frame is either there or counted";
}

}  // namespace
}  // namespace needlelab
