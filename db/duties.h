/// What one of several servers on a database does at a time. The locks are PostgreSQL's own and go with the
/// connection that has them: a server that dies gives its duties up by itself.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/store_address.h"

namespace needlelab {

/// Numbers of advisory locks: never used for anything else.
enum class Duty : std::int64_t {
  kDaily = 0x6e6c6170,  ///< what is done by the clock for the whole lab: one server's as long as it runs
  kRetention,           ///< a run of retention, or what removes an erased person's chunks
  kRescoring,           ///< a run of it
  kErasure,             ///< an erasure, or those that a start makes up for
};

/// A duty that this program has, until its end. Thread: one at a time.
class DutyLock {
 public:
  /// Whether it still has it. Where the connection was lost, another server may have had it since: it is
  /// asked for again. False: another one has it. A round trip; none where nobody else works on the database.
  Result<bool> isHeld();

 private:
  friend class Duties;
  DutyLock() = default;
  DutyLock(Connection connection, Duty duty) : connection_(std::move(connection)), duty_(duty) {}
  std::optional<Connection> connection_;  ///< nothing: nobody else works on the database
  Duty duty_ = Duty::kDaily;
};

/// Where duties are had. Thread: any.
class Duties {
 public:
  /// Nobody else works on the database: each duty is free.
  Duties() = default;
  /// Others work on the database at this address.
  explicit Duties(StoreAddress address) : address_(std::move(address)) {}

  /// Nothing: another server has it. Errors: the database's.
  Result<std::optional<DutyLock>> take(Duty duty) const;
  /// Takes kDaily, or sees whether it is still this program's; it stays so until the end of this object.
  /// False: another server has it.
  Result<bool> isOurs();

 private:
  std::optional<StoreAddress> address_;
  std::mutex mutex_;
  std::optional<DutyLock> daily_;  ///< guarded by mutex_
};

}  // namespace needlelab
