/// What servers on one database know of each other's log-ins: tokens, failures and addresses, noted reads.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "db/connection.h"
#include "db/login_key.h"

namespace needlelab {

/// One row of `login_attempts`. What it means and how it is counted, LoginGuard (server/live) and CodeGuard
/// (db/service) say.
struct LoginRow {
  enum class Kind : std::uint8_t {
    kPair = 1,      ///< a name at an address: failures in a row
    kKnown,         ///< a name at an address: it has logged in there
    kKnownAddress,  ///< an address: somebody has
    kName,          ///< a name, at any address
    kAddress,       ///< an address, for any name
    kCode,          ///< a person: wrong codes, or old passwords
  };
  double failures = 0;
  std::int64_t at_ns = 0, wait_until_ns = 0;
  bool operator==(const LoginRow&) const = default;
};

/// Of a token all but itself: of that there is a hash only. Times are of the database's clock.
struct TokenRow {
  std::string name;  ///< the person's ref
  int role = 0;
  std::int64_t access_number = 0;  ///< of the person, at the log-in
  std::int64_t password_ns = 0, expires_ns = 0;
  std::string called{};  ///< the person's name now
};

/// Does not own connection and key. Thread: as its Connection. Changes need a connection beside the writer's
/// (SharedLogins), whose transaction they are in; the last one of these says otherwise.
class LoginStore {
 public:
  LoginStore(Connection& connection, const LoginKey& key) : connection_(connection), key_(key) {}

  /// The database's clock: what several servers compare. SQLite has none: this machine's.
  Result<std::int64_t> nowNs();

  // --- attempts

  /// To the transaction's end nobody else counts.
  Status lockAttempts();
  /// `name` and `address`: those that the kind has; the other one is not looked at.
  Result<std::optional<LoginRow>> attempt(LoginRow::Kind kind, std::string_view name,
                                          std::string_view address);
  /// All kinds but kCode of a name at an address; one statement.
  Result<std::map<LoginRow::Kind, LoginRow>> attempts(std::string_view name, std::string_view address);
  /// Nothing: the row goes.
  Status putAttempt(LoginRow::Kind kind, std::string_view name, std::string_view address,
                    const std::optional<LoginRow>& row);
  /// Forgets an erased person: what has one of these names.
  Status forgetNames(std::span<const std::string> names);

  // --- tokens

  /// Stores a token. Beyond `most_of_person` the person's that ends first goes. False: the account is not as
  /// the row says any more.
  Result<bool> addToken(std::string_view token, const TokenRow& row, std::uint64_t most_of_person);
  /// The row of a valid token whose account is as it was at the log-in.
  Result<std::optional<TokenRow>> token(std::string_view token, std::int64_t now_ns);
  /// Whether its account is as at the log-in, and nobody has ended it; whether it is over by time, its own
  /// server knows. One statement, also on a reader.
  Result<bool> tokenHolds(std::string_view token);
  /// Lengthens it, up to `longest` after the log-in with the password. Returns the new end; nothing: it is no
  /// valid one.
  Result<std::optional<std::int64_t>> renewToken(std::string_view token, std::int64_t now_ns,
                                                 std::chrono::nanoseconds lifetime,
                                                 std::chrono::nanoseconds longest);
  /// Logs out. Other servers hear of it. `server`: as AccessChange.
  Status endToken(std::string_view token, std::string_view server);

  // --- bounds

  struct Bounds {
    std::uint64_t tokens = 50'000;
    std::uint64_t attempts = 100'000;  ///< of each kind; the ones idle for longest go
    /// After the last one. A guesser who waits for so long has as many tries at once as at the beginning.
    std::chrono::nanoseconds failures_kept = std::chrono::hours(1);
    std::chrono::nanoseconds codes_kept = std::chrono::hours(24);       ///< the same of codes
    std::chrono::nanoseconds known_kept = std::chrono::hours(30 * 24);  ///< after the last log-in there
  };
  /// Removes what is over and what is beyond the bounds; some of it, if others are at it.
  Status tidy(std::int64_t now_ns, const Bounds& bounds);
  // --- noted reads

  /// Notes that `what` was read; false: it was noted less than `again_after` ago. On the writer, in the
  /// transaction that adds the line of the audit log.
  Result<bool> noteRead(std::string_view what, std::chrono::nanoseconds again_after);

 private:
  Bytes keyOf(LoginRow::Kind kind, std::string_view name, std::string_view address) const;
  Connection& connection_;
  const LoginKey& key_;
};

}  // namespace needlelab
