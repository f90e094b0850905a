#include "db/store/duties.h"

namespace needlelab {
namespace {

/// Whether the connection now has the lock, newly or already.
Result<bool> tryToHold(Connection& connection, Duty duty) {
  const auto number = static_cast<std::int64_t>(duty);
  // a second lock by the same connection would need a second release
  auto row = connection.query(
      "SELECT CASE WHEN EXISTS (SELECT 1 FROM pg_locks WHERE locktype = 'advisory' AND pid = pg_backend_pid()"
      " AND classid = 0 AND objid = ?1 AND objsubid = 1) THEN 1 WHEN pg_try_advisory_lock(?1) THEN 1"
      " ELSE 0 END",
      number);
  ASSIGN_OR_RETURN(const bool there, row.step());
  return there && row.integer(0) != 0;
}

}  // namespace

Result<bool> DutyLock::isHeld() {
  if (!connection_) return true;
  return tryToHold(*connection_, duty_);
}

Result<std::optional<DutyLock>> Duties::take(Duty duty) const {
  if (!address_) return std::optional(DutyLock());
  auto connection = openAt(*address_, Connection::Mode::kReader);
  if (!connection) return storeAway(connection.error());
  ASSIGN_OR_RETURN(const bool held, tryToHold(*connection, duty));
  if (!held) return std::optional<DutyLock>();
  return std::optional(DutyLock(std::move(*connection), duty));
}

Result<bool> Duties::isOurs() {
  const std::lock_guard lock(mutex_);
  if (daily_) return daily_->isHeld();
  ASSIGN_OR_RETURN(daily_, take(Duty::kDaily));
  return daily_.has_value();
}

}  // namespace needlelab
