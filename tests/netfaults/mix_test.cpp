// Random mixes of faults, from a seed: every connection of every station gets another bad network.
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>

#include "tests/netfaults/fault_station.h"
#include "tests/support/proxy/fault_proxy.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

std::uint64_t seedFromEnvironment() {
  const char* const given = std::getenv("NEEDLELAB_SEED");
  return given != nullptr ? std::strtoull(given, nullptr, 10) : static_cast<std::uint64_t>(wallNowNs());
}

/// Several stations at once, each behind a proxy of its own. One station's bad connections end after 12, so
/// that every round ends.
void runRound(std::uint64_t seed, std::size_t count) {
  SCOPED_TRACE("NEEDLELAB_SEED=" + std::to_string(seed));
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
                                                     // every station loses its first connection somewhere,
                                                     // whatever else comes
                                                     if (n == 0 && !script.cut_at)
                                                       script.cut_at = mine.below(span);
                                                     return script;
                                                   }));
    StationSettings settings;
    settings.chunks = 30 + random.below(120);
    settings.samples = 20 + random.below(200);
    settings.period = std::chrono::milliseconds(random.below(12));
    stations.push_back(std::make_unique<FaultStation>(server, "station-" + std::to_string(i),
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
  EXPECT_GT(connections, count) << "the network was no bad one";
}

TEST(FaultMixTest, randomFaultsLoseAndDoubleNothing) {
  const bool is_long = std::getenv("NEEDLELAB_LONG") != nullptr;
  const std::uint64_t seed = seedFromEnvironment();
  for (std::uint64_t round = 0; round < (is_long ? 30u : 1u) && !testing::Test::HasFatalFailure(); ++round)
    runRound(seed + round, is_long ? 16 : 8);
}

}  // namespace
}  // namespace needlelab::test
