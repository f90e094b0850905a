// An exception in a connection's work ends only that connection: PeerConnection::endOnException.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/base/time/clock.h"
#include "server/base/log.h"
#include "server/live/port/connection.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/common/wire/loopback.h"
#include "tests/unit/db/service/test_service.h"
#include "tests/unit/server/live/bare_context.h"

namespace needlelab {
namespace {

using test::TestTls;
using testing::HasSubstr;

Task<> working(std::function<void()> work) {
  work();
  co_return;
}

/// Two connections of one server whose peers have not sent anything yet.
class ConnectionFault : public testing::Test {
 protected:
  ConnectionFault() { setLogLevel(LogLevel::kOff); }
  ~ConnectionFault() override { setLogLevel(LogLevel::kOff); }
  void TearDown() override {
    const std::vector<std::weak_ptr<PeerConnection>> left{failing, other};
    for (auto* peer : {&failing, &other}) {
      if (*peer && !(*peer)->over()) (*peer)->cut("the test ends");
      peer->reset();
    }
    EXPECT_TRUE(loop.runUntil([&] { return left[0].expired() && left[1].expired(); }));
    EXPECT_TRUE(context.connections.empty());
  }

  std::shared_ptr<PeerConnection> arrive(std::uint64_t id) {
    auto [far, near] = loop.sockets();
    clients.push_back(std::move(near));
    EXPECT_EQ(context.limits.admission.arrive(id, "127.0.0.1", steadyNowNs()).answer,
              Admission::Answer::kWelcome);
    return std::make_shared<PeerConnection>(
        context, id, Channel::make(TlsStream(std::move(far), *TestTls::get().server), {}));
  }
  void run(const std::shared_ptr<PeerConnection>& peer) {
    asio::co_spawn(loop.io, PeerConnection::run(peer), PeerConnection::endOnException(peer));
    ASSERT_TRUE(loop.runUntil([&] { return context.connections.contains(peer->id()); }));
  }
  void spawn(const std::shared_ptr<PeerConnection>& peer, std::function<void()> work) {
    asio::co_spawn(loop.io, working(std::move(work)), PeerConnection::endOnException(peer));
  }
  /// The peer's side of the TLS handshake; true: the server has accepted the connection.
  bool shakesHands(const std::shared_ptr<PeerConnection>& peer, Tcp::socket& client) {
    TlsStream stream(std::move(client), *TestTls::get().client);
    bool done = false;
    stream.async_handshake(asio::ssl::stream_base::client,
                           [&](const boost::system::error_code& error) { done = !error; });
    return loop.runUntil([&] { return done && peer->state() == ConnectionState::kGreeting; });
  }

  test::TempFolder folder;
  std::unique_ptr<Store> store = test::openStore(folder.path() / "data");
  asio::thread_pool pool{1};
  test::Loopback loop;
  test::BareServer server{loop.io, *store, {.workers = pool, .closers = pool, .views = pool, .others = pool}};
  ServerContext& context = server.context();
  std::vector<Tcp::socket> clients;
  std::shared_ptr<PeerConnection> failing = arrive(1), other = arrive(2);
};

TEST_F(ConnectionFault, whatWorkThrowsEndsItsConnectionAndTheOtherGoesOn) {
  run(failing);
  run(other);
  spawn(failing, [] { throw std::bad_alloc(); });
  ASSERT_TRUE(loop.runUntil([&] { return failing->state() == ConnectionState::kClosed; }));
  EXPECT_TRUE(failing->channel().closed());
  EXPECT_THAT(failing->channel().closeText(), HasSubstr("its work failed inside: std::bad_alloc"));
  ASSERT_EQ(context.connections.size(), 1u);
  EXPECT_TRUE(context.connections.contains(other->id()));
  // its own run() notices that it is done, and ends
  const std::weak_ptr<PeerConnection> gone = failing;
  failing.reset();
  EXPECT_TRUE(loop.runUntil([&] { return gone.expired(); }));
  EXPECT_EQ(other->state(), ConnectionState::kConnecting);
  EXPECT_TRUE(shakesHands(other, clients[1]));
}

TEST_F(ConnectionFault, whatIsNoExceptionOfTheLibrariesEndsItsConnectionToo) {
  run(failing);
  run(other);
  spawn(failing, [] { throw 5; });
  ASSERT_TRUE(loop.runUntil([&] { return failing->state() == ConnectionState::kClosed; }));
  EXPECT_THAT(failing->channel().closeText(), HasSubstr("its work failed inside: an unknown fault"));
  EXPECT_EQ(other->state(), ConnectionState::kConnecting);
}

// run() itself fails: nothing else removes the connection from the lists.
TEST_F(ConnectionFault, aFailedConnectionPassesOnItsHandshakeTurn) {
  for (const auto& peer : {failing, other}) context.connections.emplace(peer->id(), peer.get());
  context.limits.handshakes.came(failing->id(), "a", false);
  ASSERT_EQ(context.limits.handshakes.next(steadyNowNs()), failing->id());
  context.limits.handshakes.came(other->id(), "b", false);
  ASSERT_EQ(context.limits.handshakes.next(steadyNowNs()), std::nullopt) << "there is one turn";
  spawn(failing, [] { throw std::runtime_error("broken"); });
  ASSERT_TRUE(loop.runUntil([&] { return failing->state() == ConnectionState::kClosed; }));
  EXPECT_EQ(context.limits.handshakes.waiting(), 0u);
  EXPECT_EQ(context.limits.handshakes.turns(), 1u) << "the other one's";
  EXPECT_FALSE(context.connections.contains(failing->id()));
  EXPECT_TRUE(context.connections.contains(other->id()));
  context.limits.handshakes.left(other->id());
  context.connections.clear();  // neither one runs
}

TEST_F(ConnectionFault, whoHangsUpIsGoneThoughNothingIsReadFromIt) {
  // neither one runs: with the most requests in progress nothing is read
  failing->checkHangUp();
  EXPECT_FALSE(failing->gone());
  clients[0].close();
  EXPECT_TRUE(loop.runUntil([&] {
    failing->checkHangUp();
    return failing->gone();
  }));
  EXPECT_FALSE(failing->over()) << "its sent data are still read";
  other->checkHangUp();
  EXPECT_FALSE(other->gone());
  run(other);
  other->cut("it comes too often");
  EXPECT_TRUE(other->gone());
}

TEST_F(ConnectionFault, workThatEndsWellEndsNothing) {
  run(failing);
  bool done = false;
  spawn(failing, [&] { done = true; });
  ASSERT_TRUE(loop.runUntil([&] { return done; }));
  PeerConnection::endOnException(failing)(nullptr);
  EXPECT_EQ(failing->state(), ConnectionState::kConnecting);
  EXPECT_TRUE(shakesHands(failing, clients[0]));
}

TEST_F(ConnectionFault, eachFaultIsLoggedAndASecondOneEndsNothing) {
  run(failing);
  run(other);
  const auto ends = PeerConnection::endOnException(failing);
  setLogLevel(LogLevel::kError);
  testing::internal::CaptureStderr();
  ends(std::make_exception_ptr(std::runtime_error("the first")));
  ends(std::make_exception_ptr(std::runtime_error("the second")));
  const std::string log = testing::internal::GetCapturedStderr();
  setLogLevel(LogLevel::kOff);
  EXPECT_THAT(log, HasSubstr("connection_failed conn=1 who=\"\" text=\"the first\""));
  EXPECT_THAT(log, HasSubstr("connection_failed conn=1 who=\"\" text=\"the second\""));
  EXPECT_EQ(failing->state(), ConnectionState::kClosed);
  EXPECT_THAT(failing->channel().closeText(), HasSubstr("the first"));
  EXPECT_EQ(context.connections.size(), 1u);
}

}  // namespace
}  // namespace needlelab
