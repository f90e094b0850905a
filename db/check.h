/// Checks a whole database: SQLite's own integrity check, foreign keys, every chunk and every session.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

struct DatabaseCheck {
  std::uint64_t sessions = 0;
  std::uint64_t chunks = 0;
  std::uint64_t bytes = 0;          ///< of chunks
  std::vector<std::string> faults;  ///< at most kMaxFaults; empty: all is well
  [[nodiscard]] bool ok() const { return faults.empty(); }
};
inline constexpr std::size_t kMaxFaults = 100;

/// Takes a time proportional to the database's size and holds one read view throughout. A fault in the data
/// is a finding; an error means that the database could not be read. Thread: as the connection.
Result<DatabaseCheck> checkDatabase(Connection& connection);

}  // namespace needlelab
