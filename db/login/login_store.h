/// Log-in state shared by the servers on one database: tokens, failures and addresses, noted reads.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "db/people/pseudonyms.h"
#include "db/store/connection.h"

namespace needlelab {

// --- the secret for log-ins that a lab's servers share

/// Derived from the lab's pseudonym.key, which is in each server's folder. Thread: immutable.
class LoginKey {
 public:
  using Hash = PseudonymKey::Hash;
  explicit LoginKey(const PseudonymKey& lab) : key_(lab.derived("log-ins")), id_(lab.id()) {}

  /// Distinguishes the lab's key from others (PseudonymKey::id).
  [[nodiscard]] const std::string& labKeyId() const { return id_; }
  /// Keyed BLAKE2b-256: without the key, the text cannot be guessed from it. Each purpose gives other hashes.
  [[nodiscard]] Hash of(std::string_view purpose, std::string_view text) const;

  /// 32 bytes: 16 random ones, and 16 that let each server of the lab recognise its own tokens, so that other
  /// input costs no database look-up.
  [[nodiscard]] std::string makeToken() const;
  /// Whether one of the lab's servers made the token, valid or not.
  [[nodiscard]] bool madeToken(std::string_view token) const;
  /// The stored form of a token: BLAKE2b-256, as in Tokens.
  static Hash hashOfToken(std::string_view token);

 private:
  Hash key_;
  std::string id_;
};

/// One row of `login_attempts`. LoginGuard (server/live) and CodeGuard (db/service) define its meaning and
/// counting.
struct LoginRow {
  enum class Kind : std::uint8_t {
    kPair = 1,      ///< a name at an address: failures in a row
    kKnown,         ///< a name at an address: has logged in there before
    kKnownAddress,  ///< an address: someone has logged in there
    kName,          ///< a name, at any address
    kAddress,       ///< an address, for any name
    kCode,          ///< a person: wrong codes, or old passwords
  };
  double failures = 0;
  std::int64_t at_ns = 0, wait_until_ns = 0;
  bool operator==(const LoginRow&) const = default;
};

/// A token without the token itself, of which only a hash is stored. Times are of the database's clock.
struct TokenRow {
  std::string name;  ///< the person's ref
  int role = 0;
  std::int64_t access_number = 0;  ///< of the person, at log-in
  std::int64_t password_ns = 0, expires_ns = 0;
  std::string called{};  ///< the person's current name
};

/// Does not own connection and key. Thread: as its Connection. Unless stated otherwise, changes need a
/// connection beside the writer's (SharedLogins), in its transaction.
class LoginStore {
 public:
  LoginStore(Connection& connection, const LoginKey& key) : connection_(connection), key_(key) {}

  /// The database's clock, which the servers compare. On SQLite: this machine's clock.
  Result<std::int64_t> nowNs();

  // --- attempts

  /// Until the end of the transaction no one else counts.
  Status lockAttempts();
  /// `name` and `address`: as the kind requires; an unused one is ignored.
  Result<std::optional<LoginRow>> attempt(LoginRow::Kind kind, std::string_view name,
                                          std::string_view address);
  /// All kinds but kCode, for a name at an address; one statement.
  Result<std::map<LoginRow::Kind, LoginRow>> attempts(std::string_view name, std::string_view address);
  /// Nothing: removes the row.
  Status putAttempt(LoginRow::Kind kind, std::string_view name, std::string_view address,
                    const std::optional<LoginRow>& row);
  /// Removes rows with any of these names, for an erased person.
  Status forgetNames(std::span<const std::string> names);

  // --- tokens

  /// Stores a token. If the person then has more than `max_of_person`, the one that expires first is
  /// removed. False: the account no longer matches the row.
  Result<bool> addToken(std::string_view token, const TokenRow& row, std::uint64_t max_of_person);
  /// The row of a valid token whose account is unchanged since the log-in.
  Result<std::optional<TokenRow>> token(std::string_view token, std::int64_t now_ns);
  /// Whether its account is unchanged since the log-in and the token was not ended. Does not check expiry,
  /// which the token's own server knows. One statement, also on a reader.
  Result<bool> isTokenValid(std::string_view token);
  /// Extends the token, up to `longest` after the log-in with the password. Returns the new end; nothing: not
  /// a valid token.
  Result<std::optional<std::int64_t>> renewToken(std::string_view token, std::int64_t now_ns,
                                                 std::chrono::nanoseconds lifetime,
                                                 std::chrono::nanoseconds longest);
  /// Logs out; other servers are notified. `server`: as in AccessChange.
  Status endToken(std::string_view token, std::string_view server);

  // --- bounds

  struct Bounds {
    std::uint64_t tokens = 50'000;
    std::uint64_t attempts = 100'000;  ///< of each kind; those idle longest are removed
    /// After the last failure. A guesser who waits this long has as many attempts at once as at the
    /// beginning.
    std::chrono::nanoseconds failures_kept = std::chrono::hours(1);
    std::chrono::nanoseconds codes_kept = std::chrono::hours(24);       ///< same for codes
    std::chrono::nanoseconds known_kept = std::chrono::hours(30 * 24);  ///< after the last log-in there
  };
  /// Removes expired rows and those beyond the limits; only some of them if others are doing the same.
  Status tidy(std::int64_t now_ns, const Bounds& bounds);
  // --- noted reads

  /// Notes that `what` was read; false: it was noted less than `again_after` ago. Call on the writer, in the
  /// transaction that adds the audit line.
  Result<bool> noteRead(std::string_view what, std::chrono::nanoseconds again_after);

 private:
  Bytes keyOf(LoginRow::Kind kind, std::string_view name, std::string_view address) const;
  Connection& connection_;
  const LoginKey& key_;
};

}  // namespace needlelab
