/// What a run costs at PostgreSQL.
#pragma once

#include <cstdint>
#include <optional>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab::test {

struct PostgresCost {
  /// User and system, of all processes of the server of PostgreSQL since it began, those that have ended
  /// too; nothing where it does not run on this computer. A standby's are not in it.
  std::optional<double> cpu_s;
  std::uint64_t log_bytes = 0;       ///< written to its log (WAL) since the cluster was made
  std::uint64_t database_bytes = 0;  ///< of this database, tables and indexes
};

/// Thread: the connection's. Errors: those of the database.
Result<PostgresCost> postgresCost(Connection& connection);

}  // namespace needlelab::test
