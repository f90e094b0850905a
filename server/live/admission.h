/// Which connections a port admits before their log-in: bounds for each address.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>

namespace needlelab {

/// Every connection is charged to its address when it comes, and the charge is given back when it logs in. So
/// a lab of a thousand stations behind one address comes and goes as it likes, while handshakes that end in
/// nothing, half-open ones and wrong log-ins use up the room of their own address. When all places of those
/// who are not logged in are taken, the oldest connection of the address with the most of them gives way: an
/// address that opens many only hurts itself. Memory is bounded. Times: steady clock (ns), from the caller.
/// Thread: one.
class Admission {
 public:
  struct Settings {
    std::size_t max_connections = 4096;    ///< of the server, logged in or not
    std::size_t max_strangers = 1536;      ///< not logged in, of the server
    double charges_at_once = 2048;         ///< of one address (IPv6: of one /64)
    std::chrono::milliseconds refill{20};  ///< one charge leaks away in this time
    std::size_t max_addresses = 10'000;    ///< remembered; above, those without charges are forgotten
  };
  enum class Answer {
    kWelcome,
    kFull,     ///< all places are taken by those who are logged in
    kTooMany,  ///< this address has used up its charges
  };
  struct Arrival {
    Answer answer = Answer::kWelcome;
    std::optional<std::uint64_t> gives_way;  ///< this connection is to be cut for the new one
  };

  Admission() : Admission(Settings{}) {}
  explicit Admission(Settings settings) : settings_(settings) {}

  /// A connection arrives. When it is welcome, `left` must be told of its end.
  Arrival arrive(std::uint64_t id, const std::string& host, std::int64_t now_ns);
  /// It has logged in: its charge is given back, and it no longer gives way.
  void loggedIn(std::uint64_t id, std::int64_t now_ns);
  /// It is gone, logged in or not. Unknown ones are no error.
  void left(std::uint64_t id);

  [[nodiscard]] std::size_t strangers() const { return strangers_.size(); }
  [[nodiscard]] std::size_t connections() const { return strangers_.size() + known_.size(); }
  [[nodiscard]] std::size_t addresses() const { return addresses_.size(); }

  /// The key of an address: an IPv4 address, or the first 64 bits of an IPv6 one (whoever has one of
  /// those has all of them). IPv4 in IPv6 counts as IPv4. Other text stands for itself.
  static std::string keyOf(const std::string& host);

 private:
  struct Address {
    double charges = 0;
    std::int64_t at_ns = 0;
    std::size_t strangers = 0;
  };
  [[nodiscard]] double leftOf(const Address& address, std::int64_t now_ns) const;
  Address& addressOf(const std::string& key, std::int64_t now_ns);
  [[nodiscard]] std::optional<std::uint64_t> oldestOfTheGreediest() const;

  Settings settings_;
  std::unordered_map<std::string, Address> addresses_;
  std::map<std::uint64_t, std::string> strangers_;  // id → address; ids grow, so the first is the oldest
  std::unordered_set<std::uint64_t> known_;         // logged in
};

}  // namespace needlelab
