/// Work that only one of several servers on a database does at a time. The locks are PostgreSQL's and end
/// with their connection, so a server that dies gives up its duties automatically.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

#include "common/base/result.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"

namespace needlelab {

/// Advisory lock numbers, used for nothing else.
enum class Duty : std::int64_t {
  kDaily = 0x6e6c6170,  ///< scheduled work for the whole lab: held by one server for as long as it runs
  kRetention,           ///< a retention run, or the removal of an erased person's chunks
  kRescoring,           ///< a rescoring run
  kErasure,             ///< an erasure, or the pending ones at a start
};

/// A duty held by this program during the object's lifetime. Thread: one at a time.
class DutyLock {
 public:
  /// Whether the duty is still held. If the connection was lost, another server may have held it since, so
  /// the lock is requested again. False: another server has it. Costs a round trip, or none if no one else
  /// works on the database.
  Result<bool> isHeld();

 private:
  friend class Duties;
  DutyLock() = default;
  DutyLock(Connection connection, Duty duty) : connection_(std::move(connection)), duty_(duty) {}
  std::optional<Connection> connection_;  ///< nothing: no one else works on the database
  Duty duty_ = Duty::kDaily;
};

/// Hands out duties. Thread: any.
class Duties {
 public:
  /// For when no one else works on the database: each duty is free.
  Duties() = default;
  /// For when others work on the database at this address.
  explicit Duties(StoreAddress address) : address_(std::move(address)) {}

  /// Nothing: another server has the duty. Errors: the database's.
  Result<std::optional<DutyLock>> take(Duty duty) const;
  /// Takes kDaily, or checks that this program still has it; held until this object's end. False: another
  /// server has it.
  Result<bool> isOurs();

 private:
  std::optional<StoreAddress> address_;
  std::mutex mutex_;
  std::optional<DutyLock> daily_;  ///< guarded by mutex_
};

}  // namespace needlelab
