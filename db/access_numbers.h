/// Numbers of changes of access: by them servers on one database hear what others have changed, and a use of
/// an access is held against what it was opened with.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// The channel of PostgreSQL's NOTIFY, with each commit that has changed a number.
inline constexpr const char* kAccessChannel = "needlelab_access";

/// As `access_numbers.what`.
enum class AccessWhat : std::uint8_t {
  kPerson = 1,   ///< role, password, disabled
  kStation = 2,  ///< key, revoked
  kLogOut = 3,   ///< a person ended a token
  kErased = 4,   ///< somebody was erased; the name is nowhere
};

struct AccessChange {
  std::int64_t number = 0;
  AccessWhat what = AccessWhat::kPerson;
  std::string name;    ///< empty: of kErased
  std::string how;     ///< "disabled", "role", "password", "revoked", "key", "log-out", "erased"
  std::string server;  ///< whose program changed it (PostgresOptions::server); empty: another one
};

/// Triggers write the numbers (db/migrations/0001_first.sql), in the transaction that changes the access;
/// they are committed in their order. Of each account there is the last change only. Does not own the
/// connection. Thread: as its Connection.
class AccessNumberStore {
 public:
  explicit AccessNumberStore(Connection& connection) : connection_(connection) {}

  /// The last number that was given; 0: none was.
  Result<std::int64_t> last();
  /// Changes with higher numbers, in their order, `most` at most.
  Result<std::vector<AccessChange>> after(std::int64_t number, std::uint64_t most);
  /// The number of an account's last change; 0: its access was never changed.
  Result<std::int64_t> of(AccessWhat what, std::string_view name);
  /// The same for many, by name; one statement. Who has none is left out.
  Result<std::map<std::string, std::int64_t>> ofMany(AccessWhat what, std::span<const std::string> names);
  /// For what no trigger sees. In a transaction.
  Status raise(AccessWhat what, std::string_view name, std::string_view how, std::string_view server);

 private:
  Connection& connection_;
};

}  // namespace needlelab
