/// Checks a whole database: SQLite's own integrity check, foreign keys, the schema, every chunk and every
/// session.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"

namespace needlelab {

struct DatabaseCheck {
  std::uint64_t sessions = 0;
  std::uint64_t chunks = 0;
  std::uint64_t bytes = 0;          ///< of chunks
  std::vector<std::string> faults;  ///< at most kMaxFaults; empty: everything is as it was stored
  /// Chunks that are stored as they came, but cannot be decoded: each by session and chunk, at most
  /// kMaxFaults; and how many chunks of each session stand before the first of them.
  std::vector<std::string> undecodable;
  std::map<Uuid, std::uint64_t> decodable_before;
  std::uint64_t undecodable_chunks = 0;
  /// Sums of attempts that differ from the sessions (attempt_sums.h), at most kMaxFaults. They are made of
  /// what is stored: a copy with them is as good as its original.
  std::vector<std::string> sums;
  /// No damage: a copy is as good as its original. Undecodable chunks are none.
  [[nodiscard]] bool ok() const { return faults.empty(); }
};
inline constexpr std::size_t kMaxFaults = 100;

/// Takes a time proportional to the database's size and holds one read view throughout. A fault in the data
/// is a finding; an error means that the database could not be read. Thread: as the connection.
Result<DatabaseCheck> checkDatabase(Connection& connection);

}  // namespace needlelab
