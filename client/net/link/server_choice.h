/// Chooses the server of the lab to try next, and which of its addresses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "common/base/time/time_source.h"
#include "common/wire/asio.h"
#include "common/wire/endpoint.h"

namespace needlelab {

/// A place is an address of a server; a name with several addresses has several places. The place whose
/// failure is longest ago is tried first. Among places without a failure since their last welcome, the one
/// that accepted us last comes first, then the servers as listed, then a name's addresses as found, but in
/// random order within an address family, so that many stations spread over them. A round tries each place
/// once; ServerLink waits between rounds. A single place is always chosen. Deterministic for a seed. Thread:
/// one.
class ServerChoice {
 public:
  using Address = asio::ip::address;
  /// Per name; further ones are not tried.
  static constexpr std::size_t kMaxAddresses = 16;
  /// After this time a failed place counts as usable again.
  static constexpr std::int64_t kForgiven_ns = 60'000'000'000;

  /// `servers` is not empty. `time` must outlive it.
  ServerChoice(const Endpoints& servers, std::uint64_t seed, TimeSource& time = machineTime());

  /// Makes each place available again.
  void beginRound();
  /// The server to try now; null: the round is over. Ends the previous attempt.
  const Endpoint* next();
  /// The server's current addresses, at least one; returns the one to connect to. Repeated calls within an
  /// attempt return the same one.
  Address take(const std::vector<Address>& found);

  // outcome of the attempt
  /// The place did not accept us, for a reason of its own, or its name was not found.
  void failed();
  /// It refused us, and the others would do the same: the round is over, and the next one begins here.
  void refused();
  void welcomed();
  /// The connection that it had accepted was lost or given up.
  void lost();

  /// Whether there is more than one place, as far as known.
  [[nodiscard]] bool several() const;
  /// Whether there may be another server than the one being tried; IPv4 and IPv6 addresses of a name often
  /// belong to one machine.
  [[nodiscard]] bool hasOther() const;
  /// Likewise, but one that has not failed for kForgiven_ns.
  [[nodiscard]] bool hasBetter() const;

 private:
  struct Place {
    std::optional<Address> address;  // nothing before the first look-up
    std::uint64_t failed = 0;        // the sequence number of its last failure; 0: none since it accepted us
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
  std::size_t server_ = 0;    // of the attempt
  std::optional<Spot> now_;   // the place of the attempt, set by take()
  std::optional<Spot> good_;  // the last place that accepted us
  bool over_ = false;         // the round ended before each place was tried
};

}  // namespace needlelab
