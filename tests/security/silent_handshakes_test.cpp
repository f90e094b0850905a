// The attack: complete first messages of TLS handshakes and then silence, from few and from many addresses.
// Counts who gets in while the silent ones are held; nothing is timed.
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/net/link/blocking_client.h"
#include "tests/support/silent_peer.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {
namespace {

constexpr std::size_t kSilent = 300;  ///< in total; several times the places for handshakes
constexpr std::size_t kStations = 50;
constexpr auto kHour = std::chrono::hours(1);

using Peers = std::vector<std::unique_ptr<SilentPeer>>;

std::size_t answeredOf(const Peers& peers) {
  return static_cast<std::size_t>(std::count_if(
      peers.begin(), peers.end(), [](const auto& peer) { return peer->isAnswered(milliseconds(0)); }));
}

struct Attack {
  int addresses = 0;
  bool known = false;  ///< the stations' address has its reserve after the first log-in
};

class SilentHandshakes : public testing::TestWithParam<Attack> {};

// A place is held for an hour here, and a handshake may last as long: a station that had to wait for a silent
// stranger would never get in.
TEST_P(SilentHandshakes, everyStationGetsInWhileTheyAreHeld) {
  const auto [addresses, known] = GetParam();
  RunningServer server([known = known](ServerOptions& options) {
    if (!known) options.admission.known_for = std::chrono::hours(0);
    options.handshakes.patience = kHour;
    options.limits.handshake_timeout = kHour;
  });
  std::vector<std::pair<std::string, std::string>> stations;
  for (std::size_t i = 0; i < kStations; ++i) {
    const std::string name = "station-" + std::to_string(i);
    stations.emplace_back(name, server.addStation(name));
  }
  const std::string hello = clientHello();
  Peers peers;
  for (std::size_t i = 0; i < kSilent; ++i) {
    const int address = 2 + static_cast<int>(i) % addresses;
    peers.push_back(
        std::make_unique<SilentPeer>("127.0.0." + std::to_string(address), server.server().port(), hello));
  }
  // the attack has begun once the server has answered as many as have a place
  const HandshakeTurns::Settings turns;
  const std::size_t most =
      std::min(turns.places, static_cast<std::size_t>(addresses) * turns.places_of_address);
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (answeredOf(peers) < most && std::chrono::steady_clock::now() < end) {
  }
  ASSERT_GE(answeredOf(peers), most);

  std::size_t in = 0;
  std::string fault;
  for (const auto& [name, key] : stations) {
    ClientConfig config = server.config(stationLogin(name, key));
    config.connect_timeout = std::chrono::minutes(1);
    const auto client = BlockingClient::connect(config);
    in += client.ok() ? 1 : 0;
    if (!client.ok()) fault = client.error().message;
  }
  EXPECT_EQ(in, kStations) << fault;
  const auto open =
      std::count_if(peers.begin(), peers.end(), [](const auto& peer) { return peer->isOpen(); });
  EXPECT_EQ(static_cast<std::size_t>(open), kSilent) << "all of them were there all the time";
}

INSTANTIATE_TEST_SUITE_P(From, SilentHandshakes,
                         testing::Values(Attack{2, false}, Attack{20, false}, Attack{2, true},
                                         Attack{20, true}));

// All stations and all attackers at one address (a NAT): its connections give way to each other, so it
// advances at the pace of its own places.
TEST(SilentHandshakesOfOneAddress, delayTheirOwnAddressForTheirPatienceOnly) {
  RunningServer server([](ServerOptions& options) {
    options.handshakes.patience = milliseconds(20);
    options.limits.handshake_timeout = kHour;
  });
  const std::string key = server.addStation("bench");
  const std::string hello = clientHello();
  Peers peers;
  for (std::size_t i = 0; i < kSilent; ++i)
    peers.push_back(std::make_unique<SilentPeer>("127.0.0.1", server.server().port(), hello));
  ClientConfig config = server.config(stationLogin("bench", key));
  config.connect_timeout = std::chrono::minutes(1);
  const auto in = BlockingClient::connect(config);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

}  // namespace
}  // namespace needlelab::test
