/// Places of connections at a port: before log-in by address, after it by account.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include "server/live/fair_places.h"
#include "server/live/limits.h"
#include "server/live/token_bucket.h"

namespace needlelab {

/// Each new connection costs its address one charge, which a log-in refunds: a lab with a thousand stations
/// behind one address connects freely, and who fails uses up the own address's limit only. Connections
/// without log-in are strangers. Above its number an address's oldest stranger is cut; when all places are
/// taken, the oldest of the address with the most. Addresses that have logged in before have more charges and
/// places of their own, and never give way to others' strangers.
///
/// Connections that have logged in give way only to one that logs in when their places are taken: then the
/// account with the most, counted with the new one, gives up the one that it has not used for longest; of
/// equals it is the newcomer's own. So who has one connection keeps it. Some places stay free for those who
/// are about to log in, and some are for stations only. Memory is bounded. Times: steady clock (ns), from the
/// caller. Thread: one.
class Admission {
 public:
  using Settings = AdmissionLimits;
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

  explicit Admission(const Settings& settings = {}) : settings_(settings) {}

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

  [[nodiscard]] std::size_t strangers() const { return strangers_[false].size() + strangers_[true].size(); }
  [[nodiscard]] std::size_t connections() const { return strangers() + settled(); }
  [[nodiscard]] std::size_t addressesWithCharges() const { return charges_.known(); }
  [[nodiscard]] std::size_t knownAddresses() const { return known_.size(); }

  /// The key of an address: an IPv4 address, or the first 64 bits of an IPv6 one (the owner of one such
  /// address has the whole /64). Maps IPv4 in IPv6 to IPv4. Returns other text unchanged.
  static std::string keyOf(const std::string& host);

 private:
  [[nodiscard]] std::size_t settled() const { return accounts_.size() + of_proxies_.size(); }
  [[nodiscard]] bool isFullFor(bool known) const;
  [[nodiscard]] bool isFullFor(const Account& account) const;
  /// For a newcomer; for one from a known address, or of a proxy, perhaps one from a known address.
  [[nodiscard]] std::optional<std::uint64_t> strangerToCut(bool also_known) const;
  [[nodiscard]] BucketRate chargesOf(bool known) const;
  void remember(const std::string& key, std::int64_t now_ns);

  Settings settings_;
  TokenBuckets charges_;                              // of addresses
  std::array<FairPlaces<std::string>, 2> strangers_;  // by whether the address was known when they came
  FairPlaces<Account> accounts_;                      // logged in
  std::size_t people_ = 0;                            // of accounts_
  std::unordered_set<std::uint64_t> of_proxies_;
  std::unordered_map<std::string, std::int64_t> known_;  // address → time of the last log-in
};

}  // namespace needlelab
