// Tests the turns of TLS handshakes on a server: connections that never continue must not block others.
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

/// A place, and a handshake as a whole, may last an hour here: a log-in that waits for a silent peer's place
/// never ends.
constexpr auto kHour = std::chrono::hours(1);

std::function<void(ServerOptions&)> places(std::size_t in_all, std::size_t of_address) {
  return [=](ServerOptions& options) {
    options.handshakes.at_once = 1;
    options.handshakes.places = options.handshakes.places_of_known = in_all;
    options.handshakes.places_of_address = of_address;
    options.handshakes.patience = kHour;
    options.limits.handshake_timeout = kHour;
  };
}

/// Silent peers. The kernel has their bytes before any later connection; the server answers `answered_ones`.
std::vector<std::unique_ptr<SilentPeer>> silentPeers(RunningServer& server, std::size_t count,
                                                     std::size_t answered_ones, const std::string& from,
                                                     const std::string& bytes) {
  std::vector<std::unique_ptr<SilentPeer>> peers;
  for (std::size_t i = 0; i < count; ++i)
    peers.push_back(std::make_unique<SilentPeer>(from, server.server().port(), bytes));
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
  RunningServer server(places(1, 1));
  const std::string key = server.addStation("bench");
  const std::string whole = clientHello();
  ASSERT_GT(whole.size(), 100u);
  for (const std::size_t sent : {std::size_t{1}, std::size_t{11}, whole.size() - 1}) {
    SCOPED_TRACE(sent);
    server.restart();
    const auto peers = silentPeers(server, 2, 0, "127.0.0.1", whole.substr(0, sent));
    const auto in = logIn(server, key, kPatience);
    EXPECT_TRUE(in.ok()) << in.error().message;
  }
}

TEST(SilentPeers, oneAddressTakesNothingFromAnother) {
  RunningServer server(places(2, 2));
  const std::string key = server.addStation("bench");
  const auto peers = silentPeers(server, 4, 2, "127.0.0.2", clientHello());
  const auto in = logIn(server, key, kPatience);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

TEST(SilentPeers, manyAddressesThatTookAllPlacesKeepNobodyOut) {
  RunningServer server(places(4, 1));
  const std::string key = server.addStation("bench");
  std::vector<std::vector<std::unique_ptr<SilentPeer>>> peers;
  for (int address = 2; address < 6; ++address)
    peers.push_back(silentPeers(server, 2, 1, "127.0.0." + std::to_string(address), clientHello()));
  for (int again = 0; again < 3; ++again) {
    const auto in = logIn(server, key, kPatience);
    ASSERT_TRUE(in.ok()) << in.error().message;
  }
  for (const auto& of_address : peers)
    for (const auto& peer : of_address)
      EXPECT_TRUE(peer->isOpen()) << "its place was taken, not its connection";
}

// The negative control: peers that hold all places of an address keep that address waiting; otherwise the
// tests above would show nothing.
TEST(SilentPeers, anAddressWaitsForItsOwnPlaces) {
  RunningServer server(places(2, 2));
  const std::string key = server.addStation("bench");
  auto peers = silentPeers(server, 2, 2, "127.0.0.1", clientHello());
  EXPECT_FALSE(logIn(server, key, milliseconds(500)).ok());
  peers.clear();
  const auto in = logIn(server, key, kPatience);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

TEST(SilentPeers, aPlaceEndsWithItsPatience) {
  RunningServer server([](ServerOptions& options) {
    places(2, 2)(options);
    options.handshakes.patience = milliseconds(100);
  });
  const std::string key = server.addStation("bench");
  const auto peers = silentPeers(server, 2, 2, "127.0.0.1", clientHello());
  const auto in = logIn(server, key, kPatience);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

}  // namespace
}  // namespace needlelab
