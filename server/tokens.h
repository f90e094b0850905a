/// Short-lived tokens: after one log-in with the password, a person's program may come back without it.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "service/service.h"

namespace needlelab {

/// Kept in memory only, as hashes: they end with the server. Times in ns from the caller. Thread: one.
class Tokens {
 public:
  struct Issued {
    std::string token;  ///< 32 random bytes
    std::int64_t expires_ns = 0;
  };

  explicit Tokens(std::chrono::milliseconds lifetime = std::chrono::minutes(15),
                  std::size_t max_tokens = 10'000)
      : lifetime_(lifetime), max_tokens_(max_tokens) {}

  /// When all places are taken, the one that ends first is given up.
  Issued issue(const Principal& who, std::int64_t now_ns);
  /// Whose token it is, while it lasts.
  std::optional<Principal> find(std::string_view token, std::int64_t now_ns);
  /// All tokens of a name end: the person was disabled or has a new password.
  void forget(const std::string& name);
  [[nodiscard]] std::size_t size() const { return tokens_.size(); }

 private:
  struct Entry {
    Principal who;
    std::int64_t expires_ns = 0;
  };
  void dropExpired(std::int64_t now_ns);

  std::chrono::milliseconds lifetime_;
  std::size_t max_tokens_;
  std::map<std::string, Entry> tokens_;  // by BLAKE2b-256 of the token: a look-up's time tells nothing of it
};

}  // namespace needlelab
