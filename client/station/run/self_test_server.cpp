/// The server's part of the self-test: certificate, key, clock.

#include "client/net/blocking_client.h"
#include "client/net/server_link.h"
#include "client/station/run/self_test.h"
#include "client/station/run/station_key.h"
#include "common/base/clock.h"

namespace needlelab {
namespace {

constexpr int kProbes = 8;
constexpr auto kPatience = std::chrono::seconds(2);

// the least of several round trips
Status probe(BlockingClient& client, ClockProbe& clock) {
  for (int i = 1; i <= kProbes; ++i) {
    pb::Envelope ping;
    ping.mutable_ping()->set_id(static_cast<std::uint64_t>(i));
    const std::int64_t sent_ns = steadyNowNs();
    ping.mutable_ping()->set_sender_steady_ns(sent_ns);
    if (auto sent = client.send(ping); !sent.ok()) return sent;
    while (true) {
      const auto answer = client.receive(kPatience);
      if (!answer.ok()) return answer.error();
      if (!answer->has_pong() || answer->pong().id() != static_cast<std::uint64_t>(i)) continue;
      clock.add(sent_ns, answer->pong().receiver_steady_ns(), steadyNowNs());
      break;
    }
  }
  return {};
}

}  // namespace

ServerFacts measureServer(const StationOptions& options) {
  ServerFacts facts;
  if (!options.server) return facts;
  facts.asked = true;
  facts.address = options.server->host + ":" + std::to_string(options.server->port);
  const auto key = loadStationKey(options.key_file);
  if (!key.ok()) {
    facts.trouble = key.error().message;
    return facts;
  }
  ClientConfig config;
  config.server = *options.server;
  config.ca_file = options.ca_file;
  config.program = programText("station");
  config.login = stationLogin(options.station.empty() ? key->station : options.station, key->key);
  const std::int64_t from_ns = steadyNowNs();
  auto client = BlockingClient::connect(config);
  if (!client.ok()) {
    facts.trouble = client.error().message;
    return facts;
  }
  const std::int64_t welcome_wall_ns = wallNowNs();
  facts.connect_s = static_cast<double>(steadyNowNs() - from_ns) * 1e-9;
  facts.name = client->welcome().name();
  facts.program = "server " + client->welcome().server_version();
  ClockProbe clock;
  if (auto probed = probe(*client, clock); !probed.ok()) {
    facts.trouble = probed.error().message;
    return facts;
  }
  facts.round_trip_s = static_cast<double>(clock.best()->round_trip_ns) * 1e-9;
  facts.clock_offset_s = static_cast<double>(client->welcome().server_unix_ns() - welcome_wall_ns) * 1e-9 +
                         facts.round_trip_s / 2;
  client->finish();
  return facts;
}

}  // namespace needlelab
