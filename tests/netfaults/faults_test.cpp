// Each fault of the network alone: nothing is lost, nothing doubled, and the acknowledgements go forward
// only.
#include <gtest/gtest.h>

#include "tests/netfaults/fault_station.h"
#include "tests/support/proxy/fault_proxy.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

struct FaultCase {
  const char* name;
  ConnectionScript script;
  /// How many connections have it; those after them are healthy.
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

// all at once, each behind a bad network of its own: one server has to bear them together
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
                                       StationSettings{.chunks = 40, .samples = 100, .period = 10ms}));
  }
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const ConnectionScript& script = cases[i].script;
    const FaultStation& station = *stations[i];
    const UplinkState state = station.state();
    SCOPED_TRACE(std::string(cases[i].name) + ":" + script.text());
    ASSERT_TRUE(stations[i]->waitUntilDone(60s)) << state.error << state.current_trouble;
    station.expectWhole(server);
    // it was the fault that was tested
    const ProxyCounts counts = proxies[i]->counts();
    EXPECT_EQ(counts.refused, script.refuse ? 3u : 0u);
    EXPECT_EQ(counts.cuts > 0, script.cut_at.has_value());
    EXPECT_EQ(counts.corrupted > 0, script.up.corrupt_at || script.down.corrupt_at);
    EXPECT_EQ(counts.stalls > 0, script.up.stall_at || script.down.stall_at);
    EXPECT_GE(counts.duplicates, script.duplicates);
    // a network that merely is slow costs no connection
    if (cases[i].connections == 99) {
      EXPECT_EQ(station.state().connections, 1u) << station.state().error;
    }
  }
}

}  // namespace
}  // namespace needlelab::test
