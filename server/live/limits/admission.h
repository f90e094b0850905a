/// Places for connections at a port: before log-in by address, afterwards by account.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include "server/live/limits/fair_places.h"
#include "server/live/limits/limits.h"
#include "server/live/limits/token_bucket.h"

namespace needlelab {

/// Each new connection costs its address one charge, which a log-in refunds. So a lab with a thousand
/// stations behind one address connects freely, and failed attempts only use up their own address's limit.
/// Connections that have not logged in are strangers. When an address exceeds its number of strangers, its
/// oldest one is cut; when all places are taken, the oldest of the address with the most. Addresses that have
/// logged in before have more charges and their own places, and never give way to strangers from others.
///
/// Logged-in connections give way only to one that logs in when all their places are taken. Then the account
/// with the most, counting the new one, loses its least recently used connection; on a tie the newcomer's own
/// account does. So an account keeps its only connection. Some places stay free for connections about to log
/// in, and some are for stations only. Memory is bounded. Times: steady clock (ns), from the caller. Thread:
/// one.
class Admission {
 public:
  using Settings = AdmissionLimits;
  enum class Answer {
    kWelcome,
    kFull,     ///< all places are taken by connections that do not give way
    kTooMany,  ///< the address has no charges left
  };
  struct Arrival {
    Answer answer = Answer::kWelcome;
    std::optional<std::uint64_t> displaced;  ///< the connection to cut for the new one
  };
  /// The owner of a connection after log-in. A station and a person of the same name are different accounts.
  struct Account {
    std::string name;
    bool station = false;
    friend auto operator<=>(const Account&, const Account&) = default;
  };

  explicit Admission(const Settings& settings = {}) : settings_(settings) {}

  /// Registers a new connection. If it is welcome, the caller must call `left` when it ends.
  Arrival arrive(std::uint64_t id, const std::string& host, std::int64_t now_ns);
  /// For a connection of a proxy, which has many users behind it and limits its clients itself: not a
  /// stranger, costs no charge, is never cut for another.
  Arrival arriveFromProxy(std::uint64_t id);
  /// Call after a log-in, and when the connection presents a log-in again, possibly another one. Refunds the
  /// charge; the address is known from now on. kFull: the connection stays a stranger. Does nothing for
  /// unknown ids and for a proxy's connections, which carry requests of many users.
  Arrival loggedIn(std::uint64_t id, const Account& account, std::int64_t now_ns);
  /// The connection was used; the account's others now give way before it. Ignores those not logged in.
  void used(std::uint64_t id);
  /// The connection has ended, logged in or not. Ignores unknown ids.
  void left(std::uint64_t id);

  /// Whether a log-in came from there within the last `known_for`. `key`: keyOf().
  [[nodiscard]] bool knows(const std::string& key, std::int64_t now_ns) const;

  [[nodiscard]] std::size_t strangers() const { return strangers_[false].size() + strangers_[true].size(); }
  [[nodiscard]] std::size_t connections() const { return strangers() + settled(); }
  [[nodiscard]] std::size_t addressesWithCharges() const { return charges_.known(); }
  [[nodiscard]] std::size_t knownAddresses() const { return known_.size(); }

  /// The key of an address: an IPv4 address, or the first 64 bits of an IPv6 one (its owner controls the
  /// whole /64). Maps IPv4 in IPv6 to IPv4. Returns other text unchanged.
  static std::string keyOf(const std::string& host);

 private:
  [[nodiscard]] std::size_t settled() const { return accounts_.size() + of_proxies_.size(); }
  [[nodiscard]] bool isFullFor(bool known) const;
  [[nodiscard]] bool isFullFor(const Account& account) const;
  /// The stranger to cut for a newcomer. `also_known`: may be from a known address; true when the newcomer is
  /// from one, or from a proxy.
  [[nodiscard]] std::optional<std::uint64_t> strangerToCut(bool also_known) const;
  [[nodiscard]] BucketRate chargesOf(bool known) const;
  void remember(const std::string& key, std::int64_t now_ns);

  Settings settings_;
  TokenBuckets charges_;                              // of addresses
  std::array<FairPlaces<std::string>, 2> strangers_;  // by whether the address was known on arrival
  FairPlaces<Account> accounts_;                      // logged in
  std::size_t people_ = 0;                            // of accounts_
  std::unordered_set<std::uint64_t> of_proxies_;
  std::unordered_map<std::string, std::int64_t> known_;  // address → time of the last log-in
};

}  // namespace needlelab
