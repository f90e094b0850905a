/// Order and number of the TLS handshakes that the server computes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>

#include "server/live/fair_places.h"
#include "server/live/limits.h"

namespace needlelab {

/// A handshake waits for its turn, computes its answer to the peer's first message (by far its dearest step),
/// and gives the turn back: a peer that then says nothing costs no turn. From its turn on it has a place,
/// until it ends, or until `patience` after its answer. Places bound what is half done: when a thousand
/// stations reconnect at once and all are half done, all time out. A handshake that loses its place goes on.
///
/// An address waits for its own places. When all are taken, an address that has fewer than the greediest one
/// takes the oldest place of that one, so silent strangers keep nobody else waiting. Addresses that have
/// logged in before have places of their own and go first. The next turn is for the address with the fewest
/// places, and of it for the newest connection: those that have waited longest are about to time out.
///
/// Memory: of the connections that are here. Times: steady clock (ns), from the caller. Thread: one.
class HandshakeTurns {
 public:
  using Settings = HandshakeLimits;

  explicit HandshakeTurns(const Settings& settings = {}) : settings_(settings) {}

  /// The peer's first message is here. `address`: Admission::keyOf. `known`: Admission::knows.
  void came(std::uint64_t id, const std::string& address, bool known);
  /// Gives a turn; nothing: nobody waits, or nobody may begin now. Ask again after each of the other calls
  /// and at nextAt().
  std::optional<std::uint64_t> next(std::int64_t now_ns);
  /// The handshake waits for its peer: it gives its turn back. Ignored without a turn.
  void answered(std::uint64_t id, std::int64_t now_ns);
  /// The handshake has ended, well or not, or its connection has. Ignores unknown ids.
  void left(std::uint64_t id);

  /// When a place becomes free by itself; nothing when nobody waits for one.
  [[nodiscard]] std::optional<std::int64_t> nextAt() const;
  [[nodiscard]] std::size_t waiting() const { return waiting_[false].size() + waiting_[true].size(); }
  [[nodiscard]] std::size_t turns() const { return computing_.size(); }
  /// Of strangers' addresses, or of known ones: taken, and not given to another.
  [[nodiscard]] std::size_t places(bool known) const { return places_[known].size(); }
  [[nodiscard]] std::size_t begun() const { return begun_.size(); }

 private:
  void forget(std::uint64_t id);
  /// Of the addresses that may begin, null: none. If there is no room for it, there is none for any other.
  [[nodiscard]] const std::string* nextAddress(bool known) const;
  bool makeRoomFor(const std::string& address, bool known);

  Settings settings_;
  // by address; those of an array by whether it was known when they came
  std::array<FairPlaces<std::string>, 2> waiting_, places_;
  // with those whose place was given away, or two addresses could begin without end
  FairPlaces<std::string> begun_;
  std::unordered_set<std::uint64_t> computing_;                  // have a turn
  std::deque<std::pair<std::int64_t, std::uint64_t>> answered_;  // by when the place ends
};

}  // namespace needlelab
