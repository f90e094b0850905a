// A newer connection gets through before the older one's bytes and its end arrive.
#include <gtest/gtest.h>

#include "tests/netfaults/fault_station.h"
#include "tests/support/proxy/fault_proxy.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

/// The first connection's bytes stop at `hold_at` and come `late` after the second connection was made.
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

// From the handshake over log-in and OpenSession to chunks: wherever the older connection stuck, what comes
// of it later harms nothing. All at once, because each waits for its time-outs.
TEST(ReconnectOrderTest, lateBytesOfTheOlderConnectionHarmNothing) {
  // a patient server: the older connection still stands there when the station has long given it up
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
      stations.push_back(std::make_unique<FaultStation>(
          server, "hold-" + std::to_string(hold) + "-" + std::to_string(late.count()), proxies.back()->port(),
          settings));
    }
  }
  std::uint64_t late = 0;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    SCOPED_TRACE(stations[i]->name());
    ASSERT_TRUE(stations[i]->waitUntilDone(60s)) << stations[i]->state().error;
    stations[i]->expectWhole(server);
    late += proxies[i]->counts().late;
    // the older connection must not throw the newer one out
    EXPECT_LE(stations[i]->state().connections, 2u) << stations[i]->state().error;
    for (const std::string& text : stations[i]->said())
      EXPECT_EQ(text.find("CONFLICT"), std::string::npos) << text;
  }
  EXPECT_GT(late, stations.size() / 2) << "late bytes are what is tested";
}

}  // namespace
}  // namespace needlelab::test
