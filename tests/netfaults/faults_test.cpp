// Each network fault alone: no sample is lost or duplicated, and acknowledgements never go back.
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <iostream>

#include "tests/netfaults/fault_station.h"
#include "tests/support/patience.h"
#include "tests/support/proxy/fault_proxy.h"
#include "tests/support/run_form.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

struct FaultCase {
  const char* name;
  ConnectionScript script;
  /// Number of connections with the fault; later ones are healthy.
  std::uint64_t connections;
};

std::vector<FaultCase> faultCases() {
  const auto with = [](auto change) {
    ConnectionScript script;
    change(script);
    return script;
  };
  return {
      {"delayAndJitter", with([](auto& s) {
         s.up.delay = s.down.delay = 60ms;
         s.up.jitter = s.down.jitter = 60ms;
       }),
       99},
      {"littleBandwidth", with([](auto& s) { s.up.bytes_per_s = s.down.bytes_per_s = 40'000; }), 99},
      {"singleBytesUp", with([](auto& s) { s.up.piece_bytes = 1; }), 99},
      {"singleBytesDown", with([](auto& s) { s.down.piece_bytes = 1; }), 99},
      {"resetInMidFrame", with([](auto& s) {
         s.cut_at = 9001;
         s.cut = Cut::kReset;
       }),
       3},
      {"finInMidFrame", with([](auto& s) {
         s.cut_at = 9001;
         s.cut = Cut::kFin;
       }),
       3},
      {"acksCutOff", with([](auto& s) {
         s.cut_at = 1500;
         s.cut_way = Way::kDown;
       }),
       3},
      {"halfOpen", with([](auto& s) {
         s.cut_at = 9001;
         s.cut = Cut::kSilent;
       }),
       1},
      {"stallThenOn", with([](auto& s) {
         s.up.stall_at = 9001;
         s.down.stall_at = 1500;
         s.up.stall = s.down.stall = 400ms;
       }),
       99},
      {"stallBeyondTheTimeout", with([](auto& s) {
         s.down.stall_at = 1500;
         s.down.stall = 2500ms;
       }),
       1},
      {"refusedThreeTimes", with([](auto& s) { s.refuse = true; }), 3},
      {"duplicateAttempts", with([](auto& s) { s.duplicates = 3; }), 99},
      {"corruptedUp", with([](auto& s) { s.up.corrupt_at = 9001; }), 2},
      {"corruptedDown", with([](auto& s) { s.down.corrupt_at = 1500; }), 2},
      {"corruptedHandshake", with([](auto& s) { s.down.corrupt_at = 300; }), 2},
  };
}

// all at once on one server, each behind its own bad network
TEST(FaultsTest, eachFaultAloneLosesAndDoublesNothing) {
  RunningServer server(withShortLimits);
  const std::vector<FaultCase> cases = faultCases();
  std::vector<std::unique_ptr<FaultProxy>> proxies;
  std::vector<std::unique_ptr<FaultStation>> stations;
  for (const FaultCase& fault : cases) {
    proxies.push_back(
        std::make_unique<FaultProxy>(server.server().port(), 5, [&fault](std::uint64_t n, Random&) {
          return n < fault.connections ? fault.script : ConnectionScript{};
        }));
    stations.push_back(
        std::make_unique<FaultStation>(server, fault.name, proxies.back()->port(),
                                       StationSettings{.chunks = 120, .samples = 100, .period = 10ms}));
  }
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const ConnectionScript& script = cases[i].script;
    const FaultStation& station = *stations[i];
    const UplinkState state = station.state();
    SCOPED_TRACE(std::string(cases[i].name) + ":" + script.text());
    ASSERT_TRUE(stations[i]->waitUntilDone(kPatience)) << state.error << state.current_trouble;
    station.expectWhole(server);
    // the tested fault really occurred
    const ProxyCounts counts = proxies[i]->counts();
    EXPECT_EQ(counts.refused, script.refuse ? 3u : 0u);
    EXPECT_EQ(counts.cuts > 0, script.cut_at.has_value());
    EXPECT_EQ(counts.corrupted > 0, script.up.corrupt_at || script.down.corrupt_at);
    EXPECT_EQ(counts.stalls > 0, script.up.stall_at || script.down.stall_at);
    EXPECT_GE(counts.duplicates, script.duplicates);
    // a merely slow network does not end a connection
    if (cases[i].connections == 99) {
      EXPECT_EQ(station.state().connections, 1u) << station.state().error;
    }
  }
}

// A station that knows two servers, here two routes to the same store. The current route is lost again and
// again, by a reset, by an end, and silently, and comes back while the station uses the other one.
TEST(FaultsTest, eitherOfTwoServersWillDoAndNothingIsLostOrDoubled) {
  RunningServer server(withShortLimits);
  FaultProxy first(server.server().port(), 1), second(server.server().port(), 2);
  FaultStation station(server, "of-two", first.port(),
                       {.chunks = 400, .samples = 50, .period = 10ms, .other_ports = {second.port()}});
  ASSERT_TRUE(eventually([&] { return station.state().current_committed > 0; }));
  const auto nameOf = [](const FaultProxy& proxy) { return fmt::format("127.0.0.1:{}", proxy.port()); };
  std::uint64_t connections = 1;
  for (const Cut how : {Cut::kReset, Cut::kFin, Cut::kSilent, Cut::kReset}) {
    const bool at_first = station.state().server == nameOf(first);
    FaultProxy &here = at_first ? first : second, &there = at_first ? second : first;
    EXPECT_EQ(station.state().server, nameOf(here));
    here.refuseAll(true);
    here.cutAll(how);
    ASSERT_TRUE(eventually([&] { return station.state().connections == connections + 1; }))
        << station.state().error;
    ++connections;
    EXPECT_EQ(station.state().server, nameOf(there));
    here.refuseAll(false);
    const std::uint64_t committed = station.state().current_committed;
    ASSERT_TRUE(eventually([&] { return station.state().current_committed > committed; }));
  }
  ASSERT_TRUE(station.waitUntilDone(kPatience)) << station.state().error << station.state().current_trouble;
  station.expectWhole(server);
  EXPECT_EQ(station.state().connections, connections) << "it stays where it is well";
}

using namespace std::chrono_literals;

/// Several stations at once, each behind its own proxy. A station has at most 12 bad connections, so that
/// every round ends.
void runRound(std::uint64_t seed, std::size_t count) {
  SCOPED_TRACE(fmt::format("NEEDLELAB_SEED={}", seed));
  RunningServer server(withShortLimits);
  Random random(seed);
  std::vector<std::unique_ptr<FaultProxy>> proxies;
  std::vector<std::unique_ptr<FaultStation>> stations;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t span = 2000 + random.below(60'000);
    proxies.push_back(std::make_unique<FaultProxy>(server.server().port(), random.bits(),
                                                   [span](std::uint64_t n, Random& mine) {
                                                     if (n >= 12) return ConnectionScript{};
                                                     ConnectionScript script = randomScript(mine, span);
                                                     // every station loses its first connection somewhere, in
                                                     // addition to all other faults
                                                     if (n == 0 && !script.cut_at)
                                                       script.cut_at = mine.below(span);
                                                     return script;
                                                   }));
    StationSettings settings;
    settings.chunks = 30 + random.below(120);
    settings.samples = 20 + random.below(200);
    settings.period = std::chrono::milliseconds(random.below(12));
    stations.push_back(std::make_unique<FaultStation>(server, fmt::format("station-{}", i),
                                                      proxies.back()->port(), settings));
  }
  std::uint64_t connections = 0, cuts = 0, silent = 0, late = 0, corrupted = 0, stalls = 0;
  for (std::size_t i = 0; i < count; ++i) {
    ASSERT_TRUE(stations[i]->waitUntilDone(90s))
        << stations[i]->name() << ": " << stations[i]->state().error << stations[i]->state().current_trouble;
    stations[i]->expectWhole(server);
    const ProxyCounts counts = proxies[i]->counts();
    connections += counts.connections;
    cuts += counts.cuts;
    silent += counts.silent;
    late += counts.late;
    corrupted += counts.corrupted;
    stalls += counts.stalls;
  }
  std::cout << "seed " << seed << ": " << count << " stations, " << connections << " connections, " << cuts
            << " cut (" << silent << " half-open), " << late << " with late bytes, " << corrupted
            << " corrupted, " << stalls << " stalled\n";
  EXPECT_GT(connections, count) << "the network was not a bad one";
}

TEST(FaultMixTest, randomFaultsLoseAndDoubleNothing) {
  const bool is_long = longForm();
  const std::uint64_t seed = seedOr(static_cast<std::uint64_t>(wallNowNs()));
  for (std::uint64_t round = 0; round < (is_long ? 30u : 1u) && !testing::Test::HasFatalFailure(); ++round)
    runRound(seed + round, is_long ? 16 : 8);
}

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Whether the station with this name is online at the server.
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
  server.addUser("ines", pb::INSTRUCTOR, "correct horse");
  auto instructor = server.connect(personLogin("ines", "correct horse"));
  ASSERT_TRUE(instructor.ok()) << instructor.error().message;
  FaultProxy proxy(server.server().port());
  StationSettings settings{.chunks = 60, .period = 10ms};
  settings.limits = limits;
  FaultStation station(server, "s1", proxy.port(), settings);
  ASSERT_TRUE(eventually([&] { return station.state().current_committed >= 5; }));

  // the network discards everything: neither side sees an end, and new connections also fail
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
      limits.idle_timeout + kPatience);
  EXPECT_GT(at_station, limits.idle_timeout / 2) << "not before its time";
  EXPECT_GT(at_server, limits.idle_timeout / 2);
  std::cout << "half-open, limit " << limits.idle_timeout.count() << " ms: ended at the station after "
            << at_station.count() << " ms, at the server after " << at_server.count() << " ms\n";

  proxy.refuseAll(false);
  ASSERT_TRUE(station.waitUntilDone(kPatience)) << station.state().error;
  station.expectWhole(server);
}

TEST(HalfOpenTest, bothEndsNoticeWithinTheirLimits) {
  run(shortLimits());
}

TEST(HalfOpenTest, bothEndsNoticeWithinTheRealLimits) {
  if (!longForm()) GTEST_SKIP() << "takes 35 s: NEEDLELAB_LONG=1";
  run(ChannelLimits{});
}

TEST(HalfOpenTest, aPeerWhoStallsInItsHandshakeIsEnded) {
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
  // some send nothing, some half of a ClientHello
  for (int i = 0; i < 20; ++i) {
    sockets.push_back(std::make_unique<Tcp::socket>(io));
    sockets.back()->connect(
        Tcp::endpoint(asio::ip::address_v4::loopback(), i % 2 == 0 ? server.server().port() : proxy.port()));
    if (i % 2 == 1) asio::write(*sockets.back(), asio::buffer(std::string("\x16\x03\x01\x01\x00\x01", 6)));
  }
  // clients connected directly to the server see its end
  for (std::size_t i = 0; i < sockets.size(); i += 2) {
    char byte = 0;
    boost::system::error_code error;
    sockets[i]->read_some(asio::buffer(&byte, 1), error);
    EXPECT_TRUE(error) << "the server must end it";
  }
}

using namespace std::chrono_literals;

/// Holds the first connection's bytes from `hold_at` on, and delivers them `late` after the second
/// connection.
FaultProxy::Scripts lateFirst(std::uint64_t hold_at, std::chrono::milliseconds late) {
  return [=](std::uint64_t n, Random&) {
    ConnectionScript script;
    if (n == 0) {
      script.hold_at = hold_at;
      script.late_after = late;
    }
    return script;
  };
}

// From the handshake over log-in and OpenSession to chunks: wherever the older connection stalled, its late
// bytes do no harm. All at once, because each waits for its timeouts.
TEST(ReconnectOrderTest, lateBytesOfTheOlderConnectionHarmNothing) {
  // a server with long timeouts: it still holds the older connection long after the station gave it up
  RunningServer server([](ServerOptions& options) {
    options.limits = shortLimits();
    options.limits.handshake_timeout = options.limits.idle_timeout = 20s;
  });
  std::vector<std::unique_ptr<FaultProxy>> proxies;
  std::vector<std::unique_ptr<FaultStation>> stations;
  const std::vector<std::uint64_t> holds = {50, 380, 420, 460, 520, 700, 1000, 2500, 9001};
  for (const std::uint64_t hold : holds) {
    for (const auto late : {0ms, 250ms}) {
      proxies.push_back(std::make_unique<FaultProxy>(server.server().port(), 3, lateFirst(hold, late)));
      StationSettings settings{.chunks = 60, .samples = 60, .period = 30ms};
      settings.connect_timeout = 1000ms;
      stations.push_back(std::make_unique<FaultStation>(server, fmt::format("hold-{}-{}", hold, late.count()),
                                                        proxies.back()->port(), settings));
    }
  }
  std::uint64_t late = 0;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    SCOPED_TRACE(stations[i]->name());
    ASSERT_TRUE(stations[i]->waitUntilDone(kPatience)) << stations[i]->state().error;
    stations[i]->expectWhole(server);
    late += proxies[i]->counts().late;
    // the older connection must not displace the newer one
    EXPECT_LE(stations[i]->state().connections, 2u) << stations[i]->state().error;
    for (const std::string& text : stations[i]->said())
      EXPECT_EQ(text.find("CONFLICT"), std::string::npos) << text;
  }
  EXPECT_GT(late, stations.size() / 2) << "late bytes are what is tested";
}

}  // namespace

}  // namespace needlelab::test
