// An instructor's message reaches the trainee, or the instructor learns that it may be lost.
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <atomic>

#include "client/net/uplink/uplink.h"
#include "common/base/time/clock.h"
#include "common/wire/certificates.h"
#include "tests/netfaults/fault_station.h"
#include "tests/support/patience.h"
#include "tests/support/proxy/fault_proxy.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

pb::Request messageTo(const std::string& station, const std::string& text) {
  pb::Request request;
  request.mutable_trainee_message()->set_station(station);
  request.mutable_trainee_message()->set_text(text);
  return request;
}

class ControlTest : public testing::Test {
 protected:
  ControlTest()
      : server_([](ServerOptions& options) {
          withShortLimits(options);
          options.bounds.confirm_timeout = 500ms;
        }),
        proxy_(server_.server().port(), 11) {
    server_.addUser("ines", pb::INSTRUCTOR, "correct horse");
    auto client = server_.connect(personLogin("ines", "correct horse"));
    if (!client.ok()) throw std::runtime_error(client.error().message);
    instructor_.emplace(std::move(*client));
    StationSettings settings{.chunks = 1'000'000, .samples = 20, .period = 20ms};
    station_ = std::make_unique<FaultStation>(server_, "s1", proxy_.port(), settings);
    connected();
  }
  void connected() {
    ASSERT_TRUE(
        eventually([&] { return station_->state().connected && station_->state().current_committed > 0; }));
  }
  [[nodiscard]] std::size_t timesHeard(const std::string& text) const {
    const auto heard = station_->heard();
    return static_cast<std::size_t>(std::count(heard.begin(), heard.end(), text));
  }

  RunningServer server_;
  FaultProxy proxy_;
  std::optional<BlockingClient> instructor_;
  std::unique_ptr<FaultStation> station_;
};

TEST_F(ControlTest, aReplyMeansThatTheStationHasReadIt) {
  for (const auto& text : {"slower", "stop", "well done"}) {
    ASSERT_TRUE(instructor_->call(messageTo("s1", text)).ok());
    EXPECT_EQ(timesHeard(text), 1u) << "before the reply";
  }
  pb::Request next;
  next.mutable_next_exercise()->set_station("s1");
  next.mutable_next_exercise()->set_exercise_id("ball-free-practice");
  const auto reply = instructor_->call(next);
  ASSERT_TRUE(reply.ok()) << reply.error().message;
  EXPECT_EQ(station_->heard(),
            (std::vector<std::string>{"slower", "stop", "well done", "ball-free-practice"}));
}

TEST_F(ControlTest, aMessageIntoAHalfOpenConnectionIsReportedLost) {
  proxy_.refuseAll(true);
  proxy_.cutAll(Cut::kSilent);
  const auto lost = instructor_->call(messageTo("s1", "into nothing"));
  ASSERT_FALSE(lost.ok()) << "the server thinks that the station is online";
  EXPECT_NE(lost.error().message.find("did not confirm it"), std::string::npos) << lost.error().message;
  EXPECT_EQ(timesHeard("into nothing"), 0u);
  // and it is not delivered late
  proxy_.refuseAll(false);
  connected();
  ASSERT_TRUE(eventually([&] { return instructor_->call(messageTo("s1", "again")).ok(); }));
  EXPECT_GE(timesHeard("again"), 1u);
  EXPECT_EQ(timesHeard("into nothing"), 0u);
}

TEST_F(ControlTest, withCutsEachMessageArrivesOrItsLossIsReported) {
  std::uint64_t confirmed = 0, lost = 0;
  for (int n = 0; n < 16; ++n) {
    const std::string text = fmt::format("message {}", n);
    std::thread cutter([&] {
      std::this_thread::sleep_for(std::chrono::microseconds(150 * n));
      if (n % 2 == 0) proxy_.cutAll(Cut::kReset);
    });
    const auto reply = instructor_->call(messageTo("s1", text));
    cutter.join();
    if (reply.ok()) {
      ++confirmed;
      EXPECT_EQ(timesHeard(text), 1u) << text;
    } else {
      ++lost;
      EXPECT_LE(timesHeard(text), 1u) << text;
      ASSERT_TRUE(eventually([&] { return station_->state().connected; }));
    }
  }
  EXPECT_EQ(confirmed + lost, 16u);
  EXPECT_GT(confirmed, 3u);
  std::cout << confirmed << " messages confirmed, " << lost << " said to be lost\n";
}

/// Accepts connections, keeps them open and never reads.
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

 private:
  Task<> accept() {
    for (;;) {
      auto [error, socket] = co_await acceptor_.async_accept(kUseTuple);
      if (error) co_return;
      kept_.push_back(std::move(socket));
    }
  }
  asio::io_context io_{1};
  Tcp::acceptor acceptor_;
  std::vector<Tcp::socket> kept_;
  std::thread thread_;
};

UplinkConfig configFor(const MuteServer& server, const TempFolder& folder) {
  const TlsFiles files = tlsFilesIn(folder.path() / "tls");
  EXPECT_TRUE(ensureTlsFiles(files, {{"127.0.0.1"}}).ok());
  UplinkConfig config;
  config.client.tls = *makeClientTls(files.ca_certificate);
  config.client.server = {"127.0.0.1", server.port()};
  config.client.login = stationLogin("s1", std::string(32, 'k'));
  config.client.connect_timeout = 50ms;
  config.first_retry = 50ms;
  config.max_retry = 800ms;
  return config;
}

TEST(MuteServerTest, aStopEndsAWaitForAnUnresponsiveServer) {
  MuteServer server;
  TempFolder folder;
  UplinkConfig config = configFor(server, folder);
  config.client.connect_timeout = 20s;
  Uplink uplink(config, {});
  std::atomic<int> asked{0};
  const auto lesson = uplink.getLesson("ball-free-practice", "tom", std::chrono::hours(1), false,
                                       [&] { return ++asked > 4; });
  ASSERT_FALSE(lesson.ok());
  EXPECT_EQ(lesson.error().code, ErrorCode::kFailed);
  EXPECT_NE(lesson.error().message.find("stopped"), std::string::npos);
  uplink.stop();  // would wait for an hour
}

}  // namespace

}  // namespace needlelab::test
