// One side is silently gone: no end is seen, bytes go into nothing. Both ends must notice within their
// limits.
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/netfaults/fault_station.h"
#include "tests/support/proxy/fault_proxy.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kMachineStalls = 700ms;  // eight builds on two cores

/// The latest end of a connection that hears nothing: the limit itself, a quarter of it until the watch looks
/// again (2.5 s at most), and the grace for a last message.
std::chrono::milliseconds latestEnd(const ChannelLimits& limits) {
  return limits.idle_timeout + std::min<std::chrono::milliseconds>(limits.idle_timeout / 4, 2500ms) +
         limits.close_grace;
}

/// Online at the server, by name.
bool isOnline(BlockingClient& instructor, const std::string& name) {
  pb::Request request;
  request.mutable_list_stations();
  const auto reply = instructor.call(request);
  EXPECT_TRUE(reply.ok());
  if (!reply.ok()) return false;
  for (const pb::StationInfo& station : reply->stations().stations())
    if (station.name() == name) return station.online();
  return false;
}

template <typename Condition>
std::chrono::milliseconds timeUntil(Condition condition, std::chrono::milliseconds most) {
  const auto began = Clock::now();
  while (!condition() && Clock::now() - began < most) std::this_thread::sleep_for(5ms);
  return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - began);
}

void run(const ChannelLimits& limits) {
  RunningServer server([&](ServerOptions& options) { options.limits = limits; });
  server.addUser("ines", pb::INSTRUCTOR, "password1");
  auto instructor = server.connect(personLogin("ines", "password1"));
  ASSERT_TRUE(instructor.ok()) << instructor.error().message;
  FaultProxy proxy(server.server().port());
  StationSettings settings{.chunks = 60, .period = 10ms};
  settings.limits = limits;
  FaultStation station(server, "s1", proxy.port(), settings);
  ASSERT_LT(timeUntil([&] { return station.state().current_committed >= 5; }, 10s), 10s);

  // the network swallows everything: neither end sees an end; and no new connection comes through either
  proxy.refuseAll(true);
  proxy.cutAll(Cut::kSilent);
  ASSERT_TRUE(isOnline(*instructor, "s1"));
  std::chrono::milliseconds at_station{0}, at_server{0};
  const auto began = Clock::now();
  timeUntil(
      [&] {
        const auto now = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - began);
        if (at_station == 0ms && !station.state().connected) at_station = now;
        if (at_server == 0ms && !isOnline(*instructor, "s1")) at_server = now;
        return at_station > 0ms && at_server > 0ms;
      },
      latestEnd(limits) + 5s);
  EXPECT_GT(at_station, limits.idle_timeout - limits.keepalive - 100ms) << "not before its time";
  EXPECT_GT(at_server, limits.idle_timeout - limits.keepalive - 100ms);
  EXPECT_LT(at_station, latestEnd(limits) + kMachineStalls);
  EXPECT_LT(at_server, latestEnd(limits) + kMachineStalls);
  std::cout << "half-open, limit " << limits.idle_timeout.count() << " ms: ended at the station after "
            << at_station.count() << " ms, at the server after " << at_server.count() << " ms\n";

  proxy.refuseAll(false);
  ASSERT_TRUE(station.waitUntilDone(60s)) << station.state().error;
  station.expectWhole(server);
}

TEST(HalfOpenTest, bothEndsNoticeWithinTheirLimits) {
  run(shortLimits());
}

TEST(HalfOpenTest, bothEndsNoticeWithinTheRealLimits) {
  if (std::getenv("NEEDLELAB_LONG") == nullptr) GTEST_SKIP() << "takes 35 s: NEEDLELAB_LONG=1";
  run(ChannelLimits{});
}

TEST(HalfOpenTest, aPeerWhoStallsInItsHandshakeIsEndedInTime) {
  ChannelLimits limits = shortLimits();
  limits.handshake_timeout = 1500ms;
  RunningServer server([&](ServerOptions& options) { options.limits = limits; });
  FaultProxy proxy(server.server().port(), 1, [](std::uint64_t, Random&) {
    ConnectionScript script;
    script.cut_at = 100;  // in the ClientHello
    script.cut = Cut::kSilent;
    return script;
  });
  asio::io_context io;
  std::vector<std::unique_ptr<Tcp::socket>> sockets;
  // some send nothing at all, some the half of a ClientHello
  for (int i = 0; i < 20; ++i) {
    sockets.push_back(std::make_unique<Tcp::socket>(io));
    sockets.back()->connect(
        Tcp::endpoint(asio::ip::address_v4::loopback(), i % 2 == 0 ? server.server().port() : proxy.port()));
    if (i % 2 == 1) asio::write(*sockets.back(), asio::buffer(std::string("\x16\x03\x01\x01\x00\x01", 6)));
  }
  const auto began = Clock::now();
  // those that are connected to the server itself see its end
  for (std::size_t i = 0; i < sockets.size(); i += 2) {
    char byte = 0;
    boost::system::error_code error;
    sockets[i]->read_some(asio::buffer(&byte, 1), error);
    EXPECT_TRUE(error) << "the server must end it";
  }
  EXPECT_LT(Clock::now() - began,
            limits.handshake_timeout + limits.handshake_timeout / 4 + limits.close_grace + kMachineStalls);
}

}  // namespace
}  // namespace needlelab::test
