/// Admission of connections before log-in, with limits per address.
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

/// Each new connection costs its address one charge, which a log-in refunds. So a lab with a thousand
/// stations behind one address can connect and disconnect freely, while failed or half-open handshakes and
/// wrong log-ins only use up their own address's limit. When all places for connections without log-in are
/// taken, the oldest connection of the address with the most of them is cut: an address that opens many only
/// harms itself. Memory is bounded. Times: steady clock (ns), from the caller. Thread: one.
class Admission {
 public:
  struct Settings {
    std::size_t max_connections = 4096;    ///< of the server, logged in or not
    std::size_t max_strangers = 1536;      ///< not logged in, of the server
    double charges_at_once = 2048;         ///< of one address (IPv6: of one /64)
    std::chrono::milliseconds refill{20};  ///< one charge is refunded per interval
    /// In memory; above this limit, addresses without charges are dropped.
    std::size_t max_addresses = 10'000;
  };
  enum class Answer {
    kWelcome,
    kFull,     ///< logged-in connections take all places
    kTooMany,  ///< the address has used up its charges
  };
  struct Arrival {
    Answer answer = Answer::kWelcome;
    std::optional<std::uint64_t> gives_way;  ///< the connection to cut for the new one
  };

  Admission() : Admission(Settings{}) {}
  explicit Admission(Settings settings) : settings_(settings) {}

  /// Registers a new connection. When it is welcome, the caller must call `left` at its end.
  Arrival arrive(std::uint64_t id, const std::string& host, std::int64_t now_ns);
  /// After a log-in: refunds the charge; the connection can no longer be cut for a new one.
  void loggedIn(std::uint64_t id, std::int64_t now_ns);
  /// The connection has ended, logged in or not. Ignores unknown ids.
  void left(std::uint64_t id);

  [[nodiscard]] std::size_t strangers() const { return strangers_.size(); }
  [[nodiscard]] std::size_t connections() const { return strangers_.size() + known_.size(); }
  [[nodiscard]] std::size_t addresses() const { return addresses_.size(); }

  /// The key of an address: an IPv4 address, or the first 64 bits of an IPv6 one (the owner of one such
  /// address has the whole /64). Maps IPv4 in IPv6 to IPv4. Returns other text unchanged.
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
