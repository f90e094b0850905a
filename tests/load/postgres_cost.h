/// What a run costs at PostgreSQL.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "common/base/result.h"
#include "db/connection.h"
#include "tests/load/process_use.h"

namespace needlelab::test {

struct PostgresCost {
  /// User and system, of all processes of the server of PostgreSQL since it began, those that have ended
  /// too; nothing where it does not run on this computer. A standby's are not in it.
  std::optional<double> cpu_s;
  std::optional<std::uint64_t> disk_bytes;  ///< as ProcessUse, of these processes
  std::uint64_t log_bytes = 0;              ///< written to its log (WAL) since the cluster was made
  /// Of its log, to those standbys that follow now; nothing where none does, or who asks may not know.
  std::optional<std::uint64_t> sent_bytes;
  std::uint64_t database_bytes = 0;  ///< of this database, tables and indexes

  [[nodiscard]] ProcessUse use() const;
};

/// Thread: the connection's. Errors: those of the database.
Result<PostgresCost> postgresCost(Connection& connection);

/// Of all processes of a server of PostgreSQL on this computer, by its postmaster.pid. Errors: kInvalidInput.
Result<ProcessUse> postgresUse(const std::filesystem::path& pid_file);

}  // namespace needlelab::test
