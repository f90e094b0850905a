// The turns of TLS handshakes on a server: connections that stall must not block others.
#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/patience.h"
#include "tests/support/silent_peer.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;

/// A place and a whole handshake may last an hour here: a log-in that waits for a silent peer's place never
/// ends.
constexpr auto kHour = std::chrono::hours(1);

/// Places per address, and in total.
std::function<void(ServerOptions&)> places(std::size_t count) {
  return [=](ServerOptions& options) {
    options.handshakes = {.at_once = 1,
                          .places = count,
                          .places_of_known = count,
                          .places_of_address = count,
                          .patience = kHour};
    options.limits.handshake_timeout = kHour;
  };
}

/// Silent peers. The kernel has their bytes before any later connection; the server answers `answered_ones`.
std::vector<std::unique_ptr<SilentPeer>> silentPeers(RunningServer& server, std::size_t count,
                                                     std::size_t answered_ones, const std::string& bytes) {
  std::vector<std::unique_ptr<SilentPeer>> peers;
  for (std::size_t i = 0; i < count; ++i)
    peers.push_back(std::make_unique<SilentPeer>("127.0.0.1", server.server().port(), bytes));
  const auto answered = [&] {
    return static_cast<std::size_t>(std::count_if(
        peers.begin(), peers.end(), [](const auto& peer) { return peer->isAnswered(milliseconds(1)); }));
  };
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (answered() < answered_ones && std::chrono::steady_clock::now() < end) {
  }
  EXPECT_EQ(answered(), answered_ones);
  return peers;
}

Result<BlockingClient> logIn(RunningServer& server, const std::string& key, milliseconds patience) {
  ClientConfig config = server.config(stationLogin("bench", key));
  config.connect_timeout = patience;
  return BlockingClient::connect(config);
}

TEST(SilentPeers, aRecordThatIsNotThereAsAWholeTakesNoPlace) {
  RunningServer server(places(1));
  const std::string key = server.addStation("bench");
  const std::string whole = clientHello();
  ASSERT_GT(whole.size(), 100u);
  for (const std::size_t sent : {std::size_t{1}, std::size_t{11}, whole.size() - 1}) {
    SCOPED_TRACE(sent);
    server.restart();
    const auto peers = silentPeers(server, 2, 0, whole.substr(0, sent));
    const auto in = logIn(server, key, kPatience);
    EXPECT_TRUE(in.ok()) << in.error().message;
  }
}

// Negative control for this test and tests/security/silent_handshakes_test.cpp: peers that hold all places of
// an address keep that address waiting.
TEST(SilentPeers, anAddressWaitsForItsOwnPlaces) {
  RunningServer server(places(2));
  const std::string key = server.addStation("bench");
  auto peers = silentPeers(server, 2, 2, clientHello());
  EXPECT_FALSE(logIn(server, key, milliseconds(500)).ok());
  peers.clear();
  const auto in = logIn(server, key, kPatience);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

}  // namespace
}  // namespace needlelab
