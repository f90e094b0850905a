/// Which of the lab's servers is tried next, and at which of its addresses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "common/base/time_source.h"
#include "common/wire/asio.h"
#include "common/wire/endpoint.h"

namespace needlelab {

/// A place is an address of a server: a name with several addresses is several places. The place that failed
/// longest ago is tried first. Of those that have not failed since they took us, the one that took us last,
/// then the servers as they are written, then a name's addresses as they were found; but those of one family
/// by lot, so that a herd of stations spreads over them. A round tries each place once; ServerLink waits
/// between rounds. With one place it always chooses this one. Deterministic for a seed. Thread: one.
class ServerChoice {
 public:
  using Address = asio::ip::address;
  /// Of a name; further ones are not tried.
  static constexpr std::size_t kMostAddresses = 16;
  /// A place that failed before that may do again.
  static constexpr std::int64_t kForgiven_ns = 60'000'000'000;

  /// `servers` is not empty. `time` must outlive it.
  ServerChoice(const Endpoints& servers, std::uint64_t seed, TimeSource& time = machineTime());

  /// Each place may be tried again.
  void beginRound();
  /// The server that is tried now; null: the round is over. Ends the try before.
  const Endpoint* next();
  /// The addresses that this server has now, at least one: returns the one to connect to. Within a try it
  /// returns the same one again.
  Address take(const std::vector<Address>& found);

  // how the try ended
  /// The place did not take us, for a reason of its own; or its name was not found.
  void failed();
  /// It refused us, and the others would say the same: the round is over, the next one begins here.
  void refused();
  void welcomed();
  /// The connection that it had welcomed is lost, or was given up.
  void lost();

  /// Whether there is more than one place, as far as known.
  [[nodiscard]] bool several() const;
  /// Whether another server than that of this try may be there: the IPv4 and IPv6 addresses of a name are
  /// often one machine's.
  [[nodiscard]] bool hasOther() const;
  /// … that has not failed for kForgiven_ns.
  [[nodiscard]] bool hasBetter() const;

 private:
  struct Place {
    std::optional<Address> address;  // none before the first look-up
    std::uint64_t failed = 0;        // its last failure is the so many-th of all; 0: none since its welcome
    std::int64_t failed_ns = 0;
    bool tried = false;  // in this round
  };
  struct Server {
    Endpoint endpoint;
    std::vector<Place> places;
  };
  struct Spot {
    std::size_t server = 0, place = 0;
    bool operator==(const Spot&) const = default;
  };
  [[nodiscard]] Place& at(const Spot& spot) { return servers_[spot.server].places[spot.place]; }
  [[nodiscard]] std::optional<Spot> best(std::optional<std::size_t> of_server) const;
  void learn(std::size_t server, const std::vector<Address>& found);
  void fail(Place& place);
  template <typename Which>
  [[nodiscard]] bool anyOther(Which which) const;

  TimeSource& time_;
  std::mt19937_64 random_;
  std::vector<Server> servers_;
  std::uint64_t failures_ = 0;
  std::size_t server_ = 0;    // of the try
  std::optional<Spot> now_;   // the place of the try, once take() has chosen it
  std::optional<Spot> good_;  // the last that welcomed us
  bool over_ = false;         // the round, before each place was tried
};

}  // namespace needlelab
