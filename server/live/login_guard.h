/// Slows down the guessing of passwords. Keys and tokens are 32 random bytes, which nobody guesses: a right
/// one is never kept out, and wrong ones are bounded by admission.h.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <unordered_map>

namespace needlelab {

/// Three counts of failures:
/// - a name at an address: `allowed_per_name`, then a wait that doubles with each further failure;
/// - an address, whatever the names: `allowed_per_address` at once, one more each `refill_address`;
/// - a name, whatever the addresses: `allowed_everywhere` at once, one more each `refill_everywhere`.
/// People who have logged in from an address before are known there, and only the first count concerns them:
/// strangers elsewhere cannot lock a teacher out of the lab, nor one who guesses in the lab the others. The
/// price: who guesses a name at its own address keeps that name out there (not its tokens) as long as the
/// wait; and a known address has up to `allowed_per_name` tries of each known name that strangers no longer
/// have. Successes cost nothing. Memory is bounded: the names come from the network. Times: steady clock
/// (ns), from the caller. Thread: one.
class LoginGuard {
 public:
  struct Settings {
    double allowed_per_name = 5;
    std::chrono::milliseconds first_wait{10'000};
    std::chrono::milliseconds longest_wait{15 * 60'000};
    std::chrono::milliseconds quiet{3'600'000};  ///< without a failure: a name at an address starts from zero
    double allowed_per_address = 30;
    std::chrono::milliseconds refill_address{2'000};
    double allowed_everywhere = 50;
    std::chrono::milliseconds refill_everywhere{10'000};
    std::size_t max_entries = 10'000;  ///< of each kind; above, the one that was idle longest is forgotten
  };

  LoginGuard() : LoginGuard(Settings{}) {}
  explicit LoginGuard(Settings settings) : settings_(settings) {}

  /// How long this name at this address has to wait; 0: it may try.
  std::chrono::milliseconds mustWait(const std::string& name, const std::string& address,
                                     std::int64_t now_ns) const;
  /// Gives true when this failure begins a wait of the name or of the address: worth a line in the audit log.
  bool failed(const std::string& name, const std::string& address, std::int64_t now_ns);
  /// The name starts from zero at this address and is known there from now on.
  void succeeded(const std::string& name, const std::string& address, std::int64_t now_ns);
  [[nodiscard]] bool knows(const std::string& name, const std::string& address) const;

  [[nodiscard]] std::size_t entries() const {
    return pairs_.size() + known_.size() + names_.size() + addresses_.size();
  }

 private:
  struct Entry {
    double failures = 0;
    std::int64_t at_ns = 0;
  };
  using Entries = std::unordered_map<std::string, Entry>;
  using Milliseconds = std::chrono::milliseconds;
  static double leftAfter(const Entry& entry, Milliseconds refill, std::int64_t now_ns);
  static Milliseconds waitOf(const Entries& entries, const std::string& key, double allowed,
                             Milliseconds refill, std::int64_t now_ns);
  [[nodiscard]] Milliseconds waitOfPair(const std::string& key, std::int64_t now_ns) const;
  Entry& entryOf(Entries& entries, const std::string& key) const;
  void count(Entries& entries, const std::string& key, Milliseconds refill, std::int64_t now_ns) const;

  Settings settings_;
  Entries pairs_;  // name at address: failures in a row
  Entries known_;  // name at address: when it last logged in there
  Entries names_, addresses_;
};

}  // namespace needlelab
