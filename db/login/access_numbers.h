/// Numbered changes of access: servers on one database learn from them what others have changed, and compare
/// each use of an access with the number at which it was opened.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

/// The PostgreSQL NOTIFY channel, used by each commit that has changed a number.
inline constexpr const char* kAccessChannel = "needlelab_access";

/// Values of `access_numbers.what`.
enum class AccessWhat : std::uint8_t {
  kPerson = 1,   ///< role, password, disabled
  kStation = 2,  ///< key, revoked
  kLogOut = 3,   ///< a person ended a token
  kErased = 4,   ///< someone was erased; the name is not stored
};

struct AccessChange {
  std::int64_t number = 0;
  AccessWhat what = AccessWhat::kPerson;
  std::string name;    ///< empty for kErased
  std::string how;     ///< "disabled", "role", "password", "revoked", "key", "log-out", "erased"
  std::string server;  ///< whose program changed it (PostgresOptions::server); empty: some other program
};

/// Triggers write the numbers (db/migrations/0001_first.sql) in the transaction that changes the access; they
/// are committed in ascending order. Only the last change of each account is kept. Does not own the
/// connection. Thread: as its Connection.
class AccessNumberStore {
 public:
  explicit AccessNumberStore(Connection& connection) : connection_(connection) {}

  /// The last number issued; 0: none.
  Result<std::int64_t> last();
  /// Changes with higher numbers, in order; at most `most`.
  Result<std::vector<AccessChange>> after(std::int64_t number, std::uint64_t most);
  /// The number of an account's last change; 0: its access was never changed.
  Result<std::int64_t> of(AccessWhat what, std::string_view name);
  /// Same for several, by name; one statement. Names without a number are omitted.
  Result<std::map<std::string, std::int64_t>> ofMany(AccessWhat what, std::span<const std::string> names);
  /// For changes that no trigger sees. Call in a transaction.
  Status raise(AccessWhat what, std::string_view name, std::string_view how, std::string_view server);

 private:
  Connection& connection_;
};

}  // namespace needlelab
