/// Reads a whole database again: SQLite's own integrity, foreign keys, every chunk and every session.
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

/// Takes as long as the database is large; holds one view of it meanwhile. A fault of the data is a finding;
/// an error means that the database could not be looked at. Thread: as the connection.
Result<DatabaseCheck> checkDatabase(Connection& connection);

}  // namespace needlelab
