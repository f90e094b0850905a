/// Numbered changes of access: servers on one database learn from them what others have changed, and compare
/// each use of an access with the number at which it was opened.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"

namespace needlelab {

/// The PostgreSQL NOTIFY channel, used by each commit that has changed a number.
inline constexpr const char* kAccessChannel = "needlelab_access";

/// Values of `access_numbers.what`.
enum class AccessKind : std::uint8_t {
  kPerson = 1,   ///< role, password, disabled
  kStation = 2,  ///< key, revoked
  kLogOut = 3,   ///< a person ended a token
  kErased = 4,   ///< someone was erased; the name is not stored
};

struct AccessChange {
  std::int64_t number = 0;
  AccessKind what = AccessKind::kPerson;
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
  Result<std::int64_t> of(AccessKind what, std::string_view name);
  /// Same for several, by name; one statement. Names without a number are omitted.
  Result<std::map<std::string, std::int64_t>> numbersOf(AccessKind what, std::span<const std::string> names);
  /// For changes that no trigger sees. Call in a transaction.
  Status raise(AccessKind what, std::string_view name, std::string_view how, std::string_view server);

 private:
  Connection& connection_;
};

// --- receives changes that others commit: LISTEN on its own connection

/// An error of any call but connect() means that the connection is lost: connect again. Thread: a single one;
/// the calls wait for PostgreSQL.
class AccessFeed {
 public:
  virtual ~AccessFeed() = default;
  AccessFeed() = default;
  AccessFeed(const AccessFeed&) = delete;
  AccessFeed& operator=(const AccessFeed&) = delete;

  /// Connects and starts listening.
  virtual Status connect() = 0;
  /// Why changes may not arrive despite a connection, with advice; empty: they arrive.
  virtual Result<std::string> fault() = 0;
  /// Waits at most `patience` for a change. False: none.
  virtual Result<bool> wait(std::chrono::milliseconds patience) = 0;
  /// AccessNumberStore::last() and after().
  virtual Result<std::int64_t> last() = 0;
  virtual Result<std::vector<AccessChange>> after(std::int64_t number) = 0;
};

/// For a PostgreSQL database with the newest schema.
std::unique_ptr<AccessFeed> makeAccessFeed(StoreAddress address);

}  // namespace needlelab
