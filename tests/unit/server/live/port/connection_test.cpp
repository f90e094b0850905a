#include "server/live/port/connection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/server/live/raw_peer.h"

namespace needlelab {
namespace {

using namespace test;

std::string framed(const pb::Envelope& envelope) {
  return RawPeer::framed(envelope);
}

pb::Envelope helloOf(std::uint32_t major) {
  pb::Envelope envelope;
  envelope.mutable_hello()->mutable_version()->set_major(major);
  return envelope;
}

TEST(Connection, garbageBeforeLogInIsCutOffWhileAStationGoesOn) {
  RunningServer server;
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  FakeSession session("bench-1");
  ASSERT_TRUE(station->send(session.open()).ok());
  struct Case {
    const char* what;
    std::string bytes;
    pb::Refusal::Reason reason;
  };
  const std::vector<Case> cases = {
      {"length 0", std::string(4, '\0'), pb::Refusal::TOO_LARGE},
      {"4 GiB announced", std::string(4, '\xff'), pb::Refusal::TOO_LARGE},
      {"5 KiB before log-in", std::string("\0\0\x14\0", 4), pb::Refusal::TOO_LARGE},
      {"no envelope", std::string("\0\0\0\4\xff\xff\xff\xff", 8), pb::Refusal::INVALID},
      {"a chunk before hello", framed(session.chunk(0)), pb::Refusal::STATE},
      {"a request before hello", framed([] {
         pb::Envelope e;
         e.mutable_request()->mutable_list_users();
         return e;
       }()),
       pb::Refusal::STATE},
      {"log-in before hello", framed([] {
         pb::Envelope e;
         *e.mutable_login() = stationLogin("bench-1", "x");
         return e;
       }()),
       pb::Refusal::STATE},
      {"hello twice", framed(helloOf(kProtocolMajor)) + framed(helloOf(kProtocolMajor)), pb::Refusal::STATE},
      {"a server's message", framed([] {
         pb::Envelope e;
         e.mutable_welcome();
         return e;
       }()),
       pb::Refusal::STATE},
  };
  std::uint64_t seq = 0;
  for (const Case& c : cases) {
    RawPeer peer(server);
    peer.write(c.bytes);
    const auto answers = peer.readAll();
    ASSERT_FALSE(answers.empty()) << c.what;
    ASSERT_TRUE(answers.back().has_refusal()) << c.what;
    EXPECT_EQ(answers.back().refusal().reason(), c.reason) << c.what;
    EXPECT_TRUE(answers.back().refusal().fatal()) << c.what;
    ASSERT_TRUE(station->send(session.chunk(seq)).ok());
    session.waitForAck(*station, ++seq);
  }
}

TEST(Connection, aMessageOfANewerMinorIsRefusedButNotFatal) {
  RunningServer server;
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  pb::Envelope unknown;
  unknown.mutable_pong();  // encodeFrame requires a body; the unknown field is the tested part
  unknown.GetReflection()->MutableUnknownFields(&unknown)->AddVarint(777, 1);
  ASSERT_TRUE(station->send(unknown).ok());
  FakeSession session("bench-1");
  ASSERT_TRUE(station->send(session.open()).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened(); });
}

TEST(Connection, whoGoesOnMakingMistakesIsCutOff) {
  RunningServer server([](ServerOptions& options) { options.bounds.refusals = 10; });
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  pb::Envelope subscribe;
  subscribe.mutable_subscribe()->set_subscription(1);
  int refusals = 0;
  for (int i = 0; i < 20; ++i) (void)station->send(subscribe).ok();
  for (;;) {
    const auto got = station->receive(kPatience);
    if (!got.ok()) break;
    if (!got->has_refusal()) continue;
    ++refusals;
    EXPECT_EQ(got->refusal().reason(), pb::Refusal::ROLE);
  }
  EXPECT_EQ(refusals, 11);
  EXPECT_FALSE(station->connected());
}

TEST(Connection, pingsAreAnsweredWithTheServersClock) {
  RunningServer server;
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  pb::Envelope ping;
  ping.mutable_ping()->set_id(5);
  ping.mutable_ping()->set_sender_steady_ns(steadyNowNs());
  ASSERT_TRUE(station->send(ping).ok());
  const auto pong = waitFor(*station, [](const pb::Envelope& e) { return e.has_pong(); }).pong();
  EXPECT_EQ(pong.id(), 5u);
  EXPECT_EQ(pong.sender_steady_ns(), ping.ping().sender_steady_ns());
  // One machine has one steady clock: the server's time lies between request and reply.
  EXPECT_GE(pong.receiver_steady_ns(), pong.sender_steady_ns());
  EXPECT_LE(pong.receiver_steady_ns(), steadyNowNs());
}

}  // namespace
}  // namespace needlelab
