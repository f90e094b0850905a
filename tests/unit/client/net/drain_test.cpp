#include "client/net/drain.h"

#include <gmock/gmock.h>

#include "common/gesture/chunk.h"
#include "tests/unit/client/net/fake_server.h"
#include "tests/unit/client/net/spool_samples.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using Seconds = std::chrono::duration<double>;

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
    config.most_retry = 100ms;
    auto uplink = std::make_unique<Uplink>(config, UplinkEvents{});
    uplink->add(session_, true);
    return uplink;
  }
  // how it ended, and after how long
  static std::pair<DrainEnd, Seconds> drained(Uplink& uplink, const DrainPatience& patience,
                                              bool stop = false) {
    const auto began = std::chrono::steady_clock::now();
    const DrainEnd end = drain(uplink, patience, [stop] { return stop; });
    return {end, std::chrono::steady_clock::now() - began};
  }
  static bool connects(const Uplink& uplink) {
    for (int i = 0; i < 500 && !uplink.state().connected; ++i) std::this_thread::sleep_for(10ms);
    return uplink.state().connected;
  }

  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
  std::shared_ptr<SpoolSession> session_;
};

TEST_F(DrainTest, waitsUntilTheServerHasEverything) {
  FakeServer server;
  auto uplink = uplinkTo(server.clientConfig());
  const auto [end, took] = drained(*uplink, {});
  EXPECT_EQ(end, DrainEnd::kDone);
  EXPECT_TRUE(server.sessions()[session_->description().session_id()].closed);
  EXPECT_EQ(drainText(end, uplink->state()), "");
}

TEST_F(DrainTest, withoutAnyServerInThisRunItDoesNotWaitTheWholeTime) {
  auto uplink = uplinkTo(FakeServer::clientConfig(1));
  const auto [end, took] = drained(*uplink, {60s, 300ms, 30s});
  EXPECT_EQ(end, DrainEnd::kAway);
  EXPECT_LT(took, 5s);
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
  std::thread later([&] {
    std::this_thread::sleep_for(700ms);
    server = std::make_unique<FakeServer>(port);
  });
  const auto [end, took] = drained(*uplink, {20s, 100ms, 10s});
  later.join();
  EXPECT_EQ(end, DrainEnd::kDone);
  EXPECT_GE(took, 500ms);
}

TEST_F(DrainTest, aServerThatHasBeenAwayForLongIsNotWaitedFor) {
  auto server = std::make_unique<FakeServer>();
  server->faults.never_ack = true;
  auto uplink = uplinkTo(server->clientConfig());
  ASSERT_TRUE(connects(*uplink));
  server.reset();
  const auto [end, took] = drained(*uplink, {60s, 100ms, 400ms});
  EXPECT_EQ(end, DrainEnd::kAway);
  EXPECT_LT(took, 5s);
}

TEST_F(DrainTest, endsInTimeByACallersWordAndByTheServersNo) {
  FakeServer server;
  server.faults.never_ack = true;
  auto uplink = uplinkTo(server.clientConfig());
  ASSERT_TRUE(connects(*uplink));
  const auto [end, took] = drained(*uplink, {300ms, 2s, 30s});
  EXPECT_EQ(end, DrainEnd::kTimeOver);
  EXPECT_GE(took, 300ms);
  EXPECT_THAT(drainText(end, uplink->state()), HasSubstr("1 chunks could not be sent"));
  EXPECT_EQ(drained(*uplink, {}, true).first, DrainEnd::kStopped);
  uplink.reset();
  server.faults.deny_login = true;
  auto denied = uplinkTo(server.clientConfig());
  EXPECT_EQ(drained(*denied, {}).first, DrainEnd::kDenied);
}

}  // namespace
}  // namespace needlelab::test
