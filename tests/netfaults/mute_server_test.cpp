// A server that accepts and then says nothing: it is asked ever more seldom, and nobody waits for it who was
// told to stop.
#include <gtest/gtest.h>

#include <atomic>
#include <mutex>

#include "client/net/uplink.h"
#include "common/base/clock.h"
#include "common/wire/certificates.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Accepts, keeps, never reads.
class MuteServer {
 public:
  MuteServer() : acceptor_(io_, Tcp::endpoint(asio::ip::address_v4::loopback(), 0)) {
    asio::co_spawn(io_, accept(), rethrow);
    thread_ = std::thread([this] { io_.run(); });
  }
  ~MuteServer() {
    io_.stop();
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }
  std::vector<Clock::time_point> accepted() {
    const std::scoped_lock lock(mutex_);
    return accepted_;
  }

 private:
  Task<> accept() {
    for (;;) {
      auto [error, socket] = co_await acceptor_.async_accept(kUseTuple);
      if (error) co_return;
      kept_.push_back(std::move(socket));
      const std::scoped_lock lock(mutex_);
      accepted_.push_back(Clock::now());
    }
  }
  asio::io_context io_{1};
  Tcp::acceptor acceptor_;
  std::vector<Tcp::socket> kept_;
  std::mutex mutex_;
  std::vector<Clock::time_point> accepted_;
  std::thread thread_;
};

UplinkConfig configFor(const MuteServer& server, const TempFolder& folder) {
  const TlsFiles files = tlsFilesIn(folder.path() / "tls");
  EXPECT_TRUE(ensureTlsFiles(files, {"127.0.0.1"}).ok());
  UplinkConfig config;
  config.client.tls = *makeClientTls(files.ca_certificate);
  config.client.server = {"127.0.0.1", server.port()};
  config.client.login = stationLogin("s1", std::string(32, 'k'));
  config.client.connect_timeout = 50ms;
  config.first_retry = 50ms;
  config.most_retry = 800ms;
  return config;
}

TEST(MuteServerTest, isTriedAgainEverMoreSeldom) {
  MuteServer server;
  TempFolder folder;
  Uplink uplink(configFor(server, folder), {});
  std::this_thread::sleep_for(2600ms);
  const auto tries = server.accepted();
  // waits of 25–50, 50–100, 100–200, 200–400, 400–800 ms after 50 ms each: the sixth try at 1.025 to 1.8 s
  ASSERT_GE(tries.size(), 5u);
  EXPECT_LE(tries.size(), 9u);
  EXPECT_GT(tries[4] - tries[3], tries[1] - tries[0]) << "200 ms at least against 100 at most";
  EXPECT_FALSE(uplink.state().connected);
  EXPECT_NE(uplink.state().error.find("no log-in within"), std::string::npos) << uplink.state().error;
}

TEST(MuteServerTest, whoIsToldToStopDoesNotWaitForIt) {
  MuteServer server;
  TempFolder folder;
  UplinkConfig config = configFor(server, folder);
  config.client.connect_timeout = 20s;
  Uplink uplink(config, {});
  std::atomic<int> asked{0};
  const auto began = Clock::now();
  const auto lesson = uplink.getLesson("ball-free-practice", "tom", 20s, false, [&] { return ++asked > 4; });
  ASSERT_FALSE(lesson.ok());
  EXPECT_EQ(lesson.error().code, ErrorCode::kFailed);
  EXPECT_NE(lesson.error().message.find("stopped"), std::string::npos);
  uplink.stop();
  EXPECT_LT(Clock::now() - began, 1500ms);
}

}  // namespace
}  // namespace needlelab::test
