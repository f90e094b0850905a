/// Places of connections at a port: before log-in by address, after it by account.
#pragma once

#include <array>
#include <chrono>
#include <compare>
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
/// wrong log-ins only use up their own address's limit. Connections without log-in are strangers; they have
/// places, of one address and in all. Above its own number an address's oldest stranger is cut; when all
/// places are taken, the oldest of the address with the most of them: an address that opens many only harms
/// itself. Addresses that have logged in before have more charges and places of their own, and their
/// strangers never give way to those of others: a restarted server knows none of them yet.
///
/// Connections that have logged in never give way to strangers, only to one that logs in when their places
/// are taken: then the account with the most connections, counted with the new one, gives up the one that it
/// has not used for longest; of equals it is the newcomer's own. So whoever has one connection keeps it, and
/// each account ends up with its fair part. Some places stay free for those who are about to log in, and some
/// are for stations only. Memory is bounded. Times: steady clock (ns), from the caller. Thread: one.
class Admission {
 public:
  struct Settings {
    std::size_t max_connections = 4096;  ///< of the port, logged in or not
    std::size_t newcomers_one_in = 16;   ///< of this many places, one is for those who have not logged in yet
    std::size_t stations_one_in = 4;     ///< one is for stations; 0: none
    std::size_t connections_of_account = SIZE_MAX;  ///< logged in; above, its own give way
    std::size_t max_strangers = 1536;               ///< not logged in, of the server
    /// Of those, from addresses without a log-in before: the others are the reserve of known addresses.
    std::size_t max_strangers_of_unknown = 1280;
    std::size_t strangers_of_address = 1280;
    double charges_at_once = 2048;           ///< of one address (IPv6: of one /64)
    double charges_at_once_of_known = 8192;  ///< of one that has logged in before
    std::chrono::milliseconds refill{20};    ///< one charge is refunded per interval
    std::size_t max_known = 4096;            ///< addresses in memory; above, the one known for longest goes
    std::chrono::hours known_for{30 * 24};   ///< after the last log-in there
    /// In memory; above this limit, addresses without charges are dropped.
    std::size_t max_addresses = 10'000;
  };
  enum class Answer {
    kWelcome,
    kFull,     ///< connections that do not give way take all places
    kTooMany,  ///< the address has used up its charges
  };
  struct Arrival {
    Answer answer = Answer::kWelcome;
    std::optional<std::uint64_t> gives_way;  ///< the connection to cut for the new one
  };
  /// Whose a connection is after its log-in: a station and a person of one name are two.
  struct Account {
    std::string name;
    bool station = false;
    friend auto operator<=>(const Account&, const Account&) = default;
  };

  Admission() : Admission(Settings{}) {}
  explicit Admission(Settings settings) : settings_(settings) {}

  /// Registers a new connection. When it is welcome, the caller must call `left` at its end.
  Arrival arrive(std::uint64_t id, const std::string& host, std::int64_t now_ns);
  /// The same for a connection of a proxy, which has many people behind it and limits its clients itself: no
  /// stranger, no charge, never cut for another.
  Arrival arriveFromProxy(std::uint64_t id);
  /// After a log-in; again when the connection shows its log-in again, perhaps another one. Refunds the
  /// charge, knows the address from now on. kFull: the connection stays a stranger. A proxy's connections,
  /// which carry everybody's requests, and unknown ids are welcome and nothing changes.
  Arrival loggedIn(std::uint64_t id, const Account& account, std::int64_t now_ns);
  /// The connection was used: the account's others give way before it. Ignores all but those logged in.
  void used(std::uint64_t id);
  /// The connection has ended, logged in or not. Ignores unknown ids.
  void left(std::uint64_t id);

  /// Whether somebody has logged in from there in the last `known_for`. `key`: keyOf().
  [[nodiscard]] bool knows(const std::string& key, std::int64_t now_ns) const;

  [[nodiscard]] std::size_t strangers() const { return strangers_.size(); }
  [[nodiscard]] std::size_t connections() const { return strangers_.size() + settled(); }
  [[nodiscard]] std::size_t addresses() const { return addresses_.size(); }
  [[nodiscard]] std::size_t knownAddresses() const { return known_.size(); }

  /// The key of an address: an IPv4 address, or the first 64 bits of an IPv6 one (the owner of one such
  /// address has the whole /64). Maps IPv4 in IPv6 to IPv4. Returns other text unchanged.
  static std::string keyOf(const std::string& host);

 private:
  struct Address {
    double charges = 0;
    std::int64_t at_ns = 0;
    std::array<std::size_t, 2> strangers{};  // by whether the address was known when they came
    [[nodiscard]] std::size_t all() const { return strangers[0] + strangers[1]; }
  };
  struct Stranger {
    std::string address;
    bool known = false;
  };
  struct LoggedIn {
    Account account;
    std::uint64_t used = 0;  // turn of its last use
  };
  [[nodiscard]] std::size_t settled() const { return logged_in_.size() + of_proxies_.size(); }
  [[nodiscard]] bool isFullFor(const Account& account) const;
  [[nodiscard]] std::size_t connectionsOf(const Account& account) const;
  [[nodiscard]] std::optional<std::uint64_t> idlestFor(const Account& newcomer) const;
  [[nodiscard]] double leftOf(const Address& address, std::int64_t now_ns) const;
  Address& addressOf(const std::string& key, std::int64_t now_ns);
  [[nodiscard]] std::optional<std::uint64_t> oldestOf(const std::string& key) const;
  [[nodiscard]] std::optional<std::uint64_t> oldestOfTheGreediest(bool known) const;
  [[nodiscard]] bool isFullFor(bool known) const;
  void remember(const std::string& key, std::int64_t now_ns);

  Settings settings_;
  std::unordered_map<std::string, Address> addresses_;
  std::map<std::uint64_t, Stranger> strangers_;  // ids grow, so the first is the oldest
  std::size_t strangers_of_unknown_ = 0;
  std::unordered_set<std::uint64_t> of_proxies_;
  std::unordered_map<std::uint64_t, LoggedIn> logged_in_;
  // by the turn of the last use, so the first is the idlest; without empty entries
  std::map<Account, std::map<std::uint64_t, std::uint64_t>> accounts_;
  std::size_t people_ = 0;                               // of logged_in_
  std::uint64_t turn_ = 0;                               // of uses
  std::unordered_map<std::string, std::int64_t> known_;  // address → time of the last log-in
};

}  // namespace needlelab
