/// Limits password guessing. Keys and tokens are 32 random bytes and cannot be guessed: a correct one is
/// never locked out, and admission.h limits wrong ones.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>

#include "db/login/login_store.h"

#include "server/live/limits/limits.h"
#include "server/live/limits/token_bucket.h"

namespace needlelab {

/// Counts three kinds of failures:
/// - a name at an address: `allowed_per_name`, then a wait that doubles with each further failure;
/// - an address, for any name: `allowed_per_address` at once, one more each `refill_address`;
/// - a name, at any address: `allowed_everywhere` at once, one more each `refill_everywhere`.
/// For people who have logged in from an address before, only the first count applies there: strangers
/// elsewhere cannot lock a teacher out of the lab, and a guesser in the lab cannot lock out the others. The
/// price: a guesser locks a name out at the guesser's own address (but not the name's tokens). Memory is
/// bounded; names longer than any account's count as one. Times: steady clock (ns), from the caller. Thread:
/// one.
class LoginGuard {
 public:
  using Settings = LoginGuardLimits;
  struct Entry {
    double failures = 0;
    std::int64_t at_ns = 0;
    bool operator==(const Entry&) const = default;
  };

  explicit LoginGuard(const Settings& settings = {}) : settings_(settings) {}

  /// Waiting time for this name at this address; 0: it may try.
  std::chrono::milliseconds mustWait(const std::string& name, const std::string& address,
                                     std::int64_t now_ns) const;
  /// Returns true when this failure starts a wait for the name or the address; log it in the audit log.
  bool failed(const std::string& name, const std::string& address, std::int64_t now_ns);
  /// Undoes a failed(). `pair`: the kPair entry from before it.
  void takeBack(const std::string& name, const std::string& address, const Entry& pair, std::int64_t now_ns);
  /// Resets the name's failures at this address and marks it as known there.
  void succeeded(const std::string& name, const std::string& address, std::int64_t now_ns);
  [[nodiscard]] bool knows(const std::string& name, const std::string& address) const;
  /// Whether any log-in came from this address.
  [[nodiscard]] bool knowsAddress(const std::string& address) const;

  /// Its tables; LoginRow::Kind describes their keys. Without kCode.
  using Kind = LoginRow::Kind;
  static constexpr std::array<Kind, 5> kKinds = {Kind::kPair, Kind::kKnown, Kind::kKnownAddress, Kind::kName,
                                                 Kind::kAddress};
  /// The entries of the five kinds are all that it knows about this name at this address. They can be stored
  /// elsewhere and put into another guard.
  [[nodiscard]] std::optional<Entry> entry(Kind kind, const std::string& name,
                                           const std::string& address) const;
  void setEntry(Kind kind, const std::string& name, const std::string& address, const Entry& entry);
  /// Maps names that are too long for any account to a single one.
  static const std::string& countedName(const std::string& name);

  [[nodiscard]] std::size_t entries() const;

 private:
  using Entries = std::unordered_map<std::string, Entry>;
  using Milliseconds = std::chrono::milliseconds;
  [[nodiscard]] Milliseconds waitOfPair(const std::string& name, const std::string& address,
                                        std::int64_t now_ns) const;
  /// The failures of a name or an address.
  [[nodiscard]] TokenBucket bucket(Kind kind, const std::string& name, const std::string& address) const;
  Entry& entryOf(Kind kind, const std::string& name, const std::string& address);

  Settings settings_;
  std::array<Entries, 8> tables_;  // by Kind; for the known ones: the time of the last log-in
};

}  // namespace needlelab
