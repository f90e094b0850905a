/// Order and number of the TLS handshakes in progress.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>

#include "server/live/limits/fair_places.h"
#include "server/live/limits/limits.h"

namespace needlelab {

/// A handshake waits for its turn, computes its answer to the peer's first message (by far the most expensive
/// step) and gives the turn back, so a silent peer costs no turn. Together with the turn it gets a place
/// until it ends, or until `patience` after its answer. Places limit half-done handshakes: if a thousand
/// stations reconnect and all are half done, all time out. A handshake that loses its place continues.
///
/// An address waits for its own places. When all are taken, an address with fewer places than the greediest
/// one takes that one's oldest, so silent strangers do not block others. Addresses that have logged in before
/// have their own places and go first. The next turn goes to the address with the fewest places, and there to
/// the newest connection, because the oldest ones are about to time out.
///
/// Memory: in proportion to the current connections. Times: steady clock (ns), from the caller. Thread: one.
class HandshakeTurns {
 public:
  using Settings = HandshakeLimits;

  explicit HandshakeTurns(const Settings& settings = {}) : settings_(settings) {}

  /// The peer's first message has arrived. `address`: Admission::keyOf. `known`: Admission::knows.
  void came(std::uint64_t id, const std::string& address, bool known);
  /// Gives a turn. Nothing: no handshake waits, or none may begin now. Call again after each of the other
  /// calls and at nextAt().
  std::optional<std::uint64_t> next(std::int64_t now_ns);
  /// The handshake now waits for its peer and gives its turn back. Ignored if it has no turn.
  void answered(std::uint64_t id, std::int64_t now_ns);
  /// The handshake or its connection has ended. Ignores unknown ids.
  void left(std::uint64_t id);

  /// When a place becomes free by timeout; nothing if no handshake waits for one.
  [[nodiscard]] std::optional<std::int64_t> nextAt() const;
  [[nodiscard]] std::size_t waiting() const { return waiting_[false].size() + waiting_[true].size(); }
  [[nodiscard]] std::size_t turns() const { return computing_.size(); }
  /// Places in use, by strangers' addresses or by known ones; without those given to another address.
  [[nodiscard]] std::size_t places(bool known) const { return places_[known].size(); }
  [[nodiscard]] std::size_t begun() const { return begun_.size(); }

 private:
  void forget(std::uint64_t id);
  /// The next of the addresses that may begin, or null. Without room for this one, none of the
  /// others can begin.
  [[nodiscard]] const std::string* nextAddress(bool known) const;
  bool makeRoomFor(const std::string& address, bool known);

  Settings settings_;
  // by address; array index: whether the address was known on arrival
  std::array<FairPlaces<std::string>, 2> waiting_, places_;
  // includes those that lost their place; otherwise two addresses could begin handshakes without end
  FairPlaces<std::string> begun_;
  std::unordered_set<std::uint64_t> computing_;                  // have a turn
  std::deque<std::pair<std::int64_t, std::uint64_t>> answered_;  // by when the place ends
};

}  // namespace needlelab
