/// Gives long reads up when the program ends.
#pragma once

#include <atomic>

#include "db/connection.h"

namespace needlelab {

/// While it lives, statements of the connection fail soon after `cancelled` became true (SQLITE_INTERRUPT).
/// Null: nothing happens. Thread: as the connection; the flag may be set by any. Both must outlive it.
class CancelScope {
 public:
  CancelScope(Connection& connection, const std::atomic<bool>* cancelled) : connection_(connection) {
    if (cancelled == nullptr) return;
    // asked every 1000 steps of SQLite's machine: well under a millisecond apart
    sqlite3_progress_handler(
        connection_.handle(), 1000,
        [](void* flag) { return static_cast<const std::atomic<bool>*>(flag)->load() ? 1 : 0; },
        const_cast<std::atomic<bool>*>(cancelled));
  }
  ~CancelScope() { sqlite3_progress_handler(connection_.handle(), 0, nullptr, nullptr); }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

 private:
  Connection& connection_;
};

}  // namespace needlelab
