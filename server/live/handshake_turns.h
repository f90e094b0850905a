/// Order and number of the TLS handshakes that the server computes.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace needlelab {

/// A handshake waits for its turn, computes its answer to the peer's first message (key exchange and
/// signature, by far its dearest step), and gives the turn back: a peer that then says nothing costs no turn.
/// From its turn on it has a place, until it ends, or until `patience` after its answer, whichever is first.
/// Places bound what is half done, because when a thousand stations reconnect to a busy machine and all are
/// half done, all time out. Nobody is cut here: a handshake without a place goes on.
///
/// An address has a few places; whoever wants more waits for its own to become free. When all places are
/// taken, an address that has fewer than the greediest one takes the oldest place of that one. So silent
/// strangers, from few addresses or from many, keep nobody else waiting. Addresses that have logged in before
/// have places of their own and go first. The next turn is for the address with the fewest places; of its
/// connections, for the newest: those that have waited longest are about to time out, and a station that
/// times out tries again.
///
/// Memory: of the connections that are here. Times: steady clock (ns), from the caller. Thread: one.
class HandshakeTurns {
 public:
  struct Settings {
    /// Turns: this many answers are computed (0.2 ms each) before other sockets are looked at again.
    std::size_t at_once = 8;
    std::size_t places = 64;             ///< of strangers' addresses together
    std::size_t places_of_known = 64;    ///< of addresses that have logged in before, together
    std::size_t places_of_address = 24;  ///< fewer: a lab behind one address reconnects more slowly
    /// Longer than a round trip to any station; an address gets at least `places_of_address` in that time.
    std::chrono::milliseconds patience{1000};
  };

  HandshakeTurns() : HandshakeTurns(Settings{}) {}
  explicit HandshakeTurns(Settings settings) : settings_(settings) {}

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
  [[nodiscard]] std::size_t waiting() const;
  [[nodiscard]] std::size_t turns() const { return turns_; }
  /// Of strangers' addresses, or of known ones: taken, and not given to another.
  [[nodiscard]] std::size_t places(bool known) const;
  [[nodiscard]] std::size_t addresses() const { return addresses_.size(); }

 private:
  struct Place {
    std::uint64_t id = 0;
    std::int64_t until_ns = 0;
    bool given_away = false;  // still counts for its address: else an address could begin without end
  };
  struct Address {
    bool known = false;
    std::vector<std::uint64_t> waiting;    // the newest last
    std::vector<std::uint64_t> computing;  // have a turn
    std::deque<Place> answered;            // the oldest first
    std::size_t given_away = 0;            // of answered
    [[nodiscard]] std::size_t begun() const { return computing.size() + answered.size(); }
    [[nodiscard]] std::size_t places() const { return begun() - given_away; }
  };
  void freeExpired(std::int64_t now_ns);
  [[nodiscard]] Address* nextAddress(bool known);
  [[nodiscard]] bool makeRoomFor(const Address& address);

  Settings settings_;
  std::map<std::string, Address> addresses_;                   // those with a connection or a place
  std::unordered_map<std::uint64_t, std::string> address_of_;  // of those that wait, compute or have a place
  std::size_t turns_ = 0;
};

}  // namespace needlelab
