/// Slows down guessing: failed log-ins are counted for each name and for each address.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <unordered_map>

namespace needlelab {

/// Failures leak away with time: `allowed` of them at once, then one more each `refill`. Successes cost
/// nothing, so that a skills lab behind one address can log in as often as it likes. Memory is bounded: the
/// names come from the network. Times are of the steady clock (ns), from the caller. Thread: one.
class LoginGuard {
 public:
  struct Settings {
    double allowed_per_name = 5;
    double allowed_per_address = 30;
    std::chrono::milliseconds refill_name{10'000};
    std::chrono::milliseconds refill_address{2'000};
    std::size_t max_entries =
        10'000;  ///< of each kind; above, those that have leaked away are forgotten, then all
  };

  LoginGuard() : LoginGuard(Settings{}) {}
  explicit LoginGuard(Settings settings) : settings_(settings) {}

  /// How long this name at this address has to wait; 0: it may try. A person and a station of one name are
  /// two names.
  std::chrono::milliseconds mustWait(const std::string& name, const std::string& address,
                                     std::int64_t now_ns) const;
  void failed(const std::string& name, const std::string& address, std::int64_t now_ns);

  [[nodiscard]] std::size_t entries() const { return names_.size() + addresses_.size(); }

 private:
  struct Entry {
    double failures = 0;
    std::int64_t at_ns = 0;
  };
  using Entries = std::unordered_map<std::string, Entry>;
  static double leftAfter(const Entry& entry, std::chrono::milliseconds refill, std::int64_t now_ns);
  static std::chrono::milliseconds waitOf(const Entries& entries, const std::string& key, double allowed,
                                          std::chrono::milliseconds refill, std::int64_t now_ns);
  void count(Entries& entries, const std::string& key, std::chrono::milliseconds refill,
             std::int64_t now_ns) const;

  Settings settings_;
  Entries names_, addresses_;
};

}  // namespace needlelab
