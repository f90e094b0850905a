/// Checks a whole database: SQLite's integrity check, foreign keys, the schema, and every session
/// (sessions/session_check.cpp).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"

namespace needlelab {

struct DatabaseCheck {
  std::uint64_t sessions = 0;
  std::uint64_t chunks = 0;
  std::uint64_t bytes = 0;          ///< of chunks
  std::vector<std::string> faults;  ///< at most kMaxFaults; empty: everything is as stored
  /// Chunks that are stored as received but cannot be decoded, by session and chunk, at most kMaxFaults; and
  /// for each session the number of chunks before its first one.
  std::vector<std::string> undecodable;
  std::map<Uuid, std::uint64_t> decodable_before;
  std::uint64_t undecodable_chunks = 0;
  /// Sums of attempts that do not match the sessions (attempt_sums.h), at most kMaxFaults. They are derived
  /// data, so a copy that has them is as good as its original.
  std::vector<std::string> sums;
  /// No damage: a copy is as good as its original. Undecodable chunks do not count as damage.
  [[nodiscard]] bool ok() const { return faults.empty(); }
};

/// Takes time proportional to the database's size and holds one read view throughout. A fault in the data is
/// a finding; an error means that the database could not be read. Thread: as the connection.
Result<DatabaseCheck> checkDatabase(Connection& connection);

}  // namespace needlelab
