/// Short-lived tokens: after one log-in with the password, a person's program may come back without it.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "db/service/service.h"

namespace needlelab {

/// Kept in memory only, as hashes: they end with the server. A token may be exchanged for a new one before it
/// expires, but not for longer than `longest` after the password: a stolen one does not live for ever. Times
/// in ns from the caller. Thread: one.
class Tokens {
 public:
  struct Holder {
    Principal who;
    std::int64_t password_ns = 0;  ///< when the password was given from which the token comes
  };
  static constexpr std::size_t kMostOfPerson = 512;
  struct Issued {
    std::string token;  ///< 32 random bytes
    std::int64_t expires_ns = 0;
  };

  explicit Tokens(std::chrono::milliseconds lifetime = std::chrono::minutes(15),
                  std::size_t max_tokens = 10'000, std::chrono::milliseconds longest = std::chrono::hours(12))
      : lifetime_(lifetime), longest_(longest), max_tokens_(max_tokens) {}

  /// When all places are taken, or this person has kMostOfPerson, the one that ends first is given up: who
  /// logs in again and again costs nobody else a token.
  Issued issue(const Holder& holder, std::int64_t now_ns);
  /// The holder of a token, while it lasts.
  std::optional<Holder> find(std::string_view token, std::int64_t now_ns);
  /// Lets a token that was just used last as long as a new one would, `longest` from the password at most.
  /// When it ends now; nothing for an unknown token.
  std::optional<std::int64_t> renew(std::string_view token, std::int64_t now_ns);
  /// When it ends.
  [[nodiscard]] std::optional<std::int64_t> endOf(std::string_view token, std::int64_t now_ns) const;
  /// Log-out. False: there was none.
  bool end(std::string_view token);
  /// All tokens of a name end: the person was disabled or has a new password. How many those were.
  std::size_t forget(const std::string& name);
  [[nodiscard]] std::size_t size() const { return tokens_.size(); }

 private:
  struct Entry {
    Holder holder;
    std::int64_t expires_ns = 0;
  };
  void dropExpired(std::int64_t now_ns);

  std::chrono::milliseconds lifetime_, longest_;
  std::size_t max_tokens_;
  std::map<std::string, Entry> tokens_;  // by BLAKE2b-256 of the token: a look-up's time tells nothing of it
};

}  // namespace needlelab
