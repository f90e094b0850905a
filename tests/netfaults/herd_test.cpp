// A thundering herd: the server is killed under load, and all stations come back at once.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "tests/netfaults/herd_server.h"
#include "tests/netfaults/herd_station.h"
#include "tests/soak/process_sample.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

double secondsSince(HerdClock::time_point from, HerdClock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

struct Storm {
  std::size_t stations;
  std::chrono::milliseconds outage;
  std::chrono::milliseconds patience;
};

// The whole herd in one thread of this process; TLS on both sides shares the machine's cores.
void run(const Storm& storm) {
  HerdServer server(storm.stations);
  const HerdChunks chunks(600);
  HerdTally tally;
  asio::io_context io{1};
  std::vector<std::unique_ptr<HerdStation>> herd;
  for (std::size_t i = 0; i < storm.stations; ++i) {
    ClientConfig config;
    config.server = {"127.0.0.1", server.port()};
    config.tls = server.tls();
    config.program = "herd";
    config.login = stationLogin(HerdServer::nameOf(i), server.key(i));
    herd.push_back(std::make_unique<HerdStation>(io, config, i + 1, chunks, tally));
    asio::co_spawn(io, HerdStation::run(*herd.back()), rethrow);
  }
  const auto count = [&](auto condition) {
    return static_cast<std::size_t>(
        std::count_if(herd.begin(), herd.end(), [&](const auto& s) { return condition(*s); }));
  };
  const auto until = [&](auto condition, std::chrono::milliseconds limit) {
    const auto end = HerdClock::now() + limit;
    while (!condition() && HerdClock::now() < end) io.run_for(5ms);
    return condition();
  };
  // the first storm: all connect for the first time
  const auto first = HerdClock::now();
  ASSERT_TRUE(until([&] { return count([](const HerdStation& s) { return s.whole(); }) == storm.stations; },
                    storm.patience))
      << server.said().substr(0, 2000);
  std::cout << "herd of " << storm.stations << ": first log-ins and chunks took "
            << secondsSince(first, HerdClock::now()) << " s";
  for (const auto& [kind, times] : tally.failed) std::cout << "; " << times << " × " << kind;
  std::cout << '\n';
  io.run_for(2s);  // streaming

  for (const auto& station : herd) station->outage();
  server.kill();
  io.run_for(storm.outage);
  tally = {};
  const auto killed_for = storm.outage;
  const auto start = HerdClock::now();
  // starting takes its time as well, and the herd goes on trying meanwhile
  std::atomic<bool> up{false};
  std::thread starter([&] {
    server.start();
    up = true;
  });
  const bool started = until([&] { return up.load(); }, 60s);
  starter.join();
  ASSERT_TRUE(started);
  const auto listening = HerdClock::now();
  EXPECT_TRUE(until(
      [&] { return count([](const HerdStation& s) { return s.wholeAt().has_value(); }) == storm.stations; },
      storm.patience))
      << count([](const HerdStation& s) { return s.wholeAt().has_value(); }) << " of " << storm.stations
      << " are whole again\n"
      << server.said().substr(0, 2000);

  std::vector<double> whole_s, connected_s;
  for (const auto& station : herd)
    if (station->wholeAt()) whole_s.push_back(secondsSince(listening, *station->wholeAt()));
  for (const auto& at : tally.connected) connected_s.push_back(secondsSince(listening, at));
  std::sort(whole_s.begin(), whole_s.end());
  std::sort(connected_s.begin(), connected_s.end());
  ASSERT_FALSE(whole_s.empty());
  // the most handshakes within any second
  std::size_t most = 0;
  for (std::size_t i = 0, j = 0; j < connected_s.size(); ++j) {
    while (connected_s[j] - connected_s[i] > 1.0) ++i;
    most = std::max(most, j - i + 1);
  }
  std::cout << "outage " << killed_for.count() << " ms, start " << secondsSince(start, listening)
            << " s; whole again (logged in, resumed, backlog acknowledged) after the server listens: median "
            << whole_s[whole_s.size() / 2] << " s, 95 % " << whole_s[whole_s.size() * 95 / 100] << " s, last "
            << whole_s.back() << " s; " << tally.connected.size() << " log-ins, at most " << most
            << " in a second; lost again " << tally.lost;
  for (const auto& [kind, times] : tally.failed) std::cout << "; " << times << " × " << kind;
  if (const auto sample = sampleProcess(server.pid()))
    std::cout << "; server " << sample->rss_KiB / 1024 << " MiB, " << sample->handles << " handles";
  std::cout << '\n';
  EXPECT_EQ(tally.went_back, 0u) << "acknowledged, and not there after the kill";
  // who was let in stays in: the storm of the others ends nobody's connection
  EXPECT_EQ(tally.lost, 0u);

  // complete: the server checks each session's count and hash from its database
  for (const auto& station : herd) station->end();
  EXPECT_TRUE(
      until([&] { return count([](const HerdStation& s) { return s.complete(); }) == storm.stations; },
            storm.patience));
  for (const auto& station : herd) EXPECT_EQ(station->trouble(), "");
  EXPECT_EQ(server.stop(), 0);
}

TEST(HerdTest, sixtyStationsAreWholeAgainAfterAKill) {
  run({60, 500ms, 40s});
}

TEST(HerdTest, aThousandStationsAreWholeAgainAfterAKill) {
  if (std::getenv("NEEDLELAB_LONG") == nullptr) GTEST_SKIP() << "takes some minutes: NEEDLELAB_LONG=1";
  run({1000, 3s, 180s});
}

}  // namespace
}  // namespace needlelab::test
