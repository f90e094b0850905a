/// Short-lived tokens: after a log-in with the password, a person's program can reconnect without it.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "db/login/login_store.h"
#include "db/service/service.h"

#include "server/live/limits/limits.h"

namespace needlelab {

/// Keeps only hashes, only in memory. Tokens end with the server, and `longest` after the password log-in
/// even if exchanged for new ones. Times in ns from the caller. Thread: one.
class Tokens {
 public:
  struct Holder {
    Principal who;
    std::int64_t password_ns = 0;  ///< time of the password log-in behind the token
  };
  struct Issued {
    std::string token;  ///< 32 random bytes
    std::int64_t expires_ns = 0;
  };

  explicit Tokens(const TokenLimits& limits = {}) : limits_(limits) {}

  /// Issues a token. When all places are taken, or this person has too many, revokes the token that expires
  /// first; a person's frequent log-ins never revoke another person's token.
  Issued issue(const Holder& holder, std::int64_t now_ns);
  /// Stores a token that was issued elsewhere, with its own expiry.
  void keep(std::string_view token, const Holder& holder, std::int64_t expires_ns, std::int64_t now_ns);
  /// The holder of a valid token.
  [[nodiscard]] std::optional<Holder> find(std::string_view token, std::int64_t now_ns) const;
  /// Extends a just-used token to the lifetime of a new one, but at most to `longest` after the password
  /// log-in. Returns its new expiry; nothing for an unknown token.
  std::optional<std::int64_t> renew(std::string_view token, std::int64_t now_ns);
  /// The expiry time.
  [[nodiscard]] std::optional<std::int64_t> endOf(std::string_view token, std::int64_t now_ns) const;
  /// Logs out. False: the token does not exist.
  bool end(std::string_view token);
  /// Revokes all tokens of a name, after the person was disabled or got a new password. Returns their number.
  std::size_t forget(const std::string& name);
  /// Drops expired tokens.
  void tidy(std::int64_t now_ns);
  [[nodiscard]] std::vector<Principal> holders() const;
  [[nodiscard]] std::size_t size() const { return tokens_.size(); }

 private:
  struct Entry {
    Holder holder;
    std::int64_t expires_ns = 0;
  };
  /// Null: unknown or expired.
  [[nodiscard]] const Entry* entryOf(std::string_view token, std::int64_t now_ns) const;
  [[nodiscard]] std::int64_t expiryOf(const Holder& holder, std::int64_t now_ns) const;

  TokenLimits limits_;
  // by hash: the lookup's duration reveals nothing about the token
  std::map<LoginKey::Hash, Entry> tokens_;
};

}  // namespace needlelab
