#include "tests/load/postgres_cost.h"

#include <sys/types.h>

#include <cstdlib>
#include <optional>
#include <sstream>
#include <string>

#include "common/base/files.h"

namespace needlelab::test {
namespace {

// nothing: there is no such process, or it is none of PostgreSQL
std::optional<pid_t> parentOf(std::int64_t pid) {
  const std::string text = statLineOf(static_cast<pid_t>(pid));
  const auto end = text.rfind(')');
  if (end == std::string::npos || text.find("(postgres)") == std::string::npos) return std::nullopt;
  std::istringstream fields(text.substr(end + 1));
  std::string state;
  pid_t parent = 0;
  fields >> state >> parent;
  return parent;
}

}  // namespace

ProcessUse PostgresCost::use() const {
  ProcessUse use;
  use.name = "PostgreSQL";
  use.cpu_s = cpu_s;
  use.disk_bytes = disk_bytes;
  use.log_bytes = log_bytes;
  use.sent_bytes = sent_bytes;
  return use;
}

Result<PostgresCost> postgresCost(Connection& connection) {
  auto query = connection.prepare(
      "SELECT pg_backend_pid(), CAST(pg_wal_lsn_diff(pg_current_wal_insert_lsn(), '0/0') AS BIGINT),"
      " pg_database_size(current_database()),"
      " (SELECT CAST(coalesce(sum(pg_wal_lsn_diff(sent_lsn, '0/0')), 0) AS BIGINT) FROM "
      "pg_stat_replication)");
  ASSIGN_OR_RETURN(const bool there, query.step());
  if (!there) return Error{ErrorCode::kFailed, "PostgreSQL does not say its process and sizes"};
  PostgresCost cost;
  cost.log_bytes = query.natural(1);
  cost.database_bytes = query.natural(2);
  if (const std::uint64_t sent = query.natural(3); sent > 0) cost.sent_bytes = sent;
  // a connection's process is a child of the server's first one, as are all others
  if (const auto first = parentOf(query.integer(0)); first && parentOf(*first)) {
    const ProcessUse use = useWithChildren(*first);
    cost.cpu_s = use.cpu_s;
    cost.disk_bytes = use.disk_bytes;
  }
  return cost;
}

Result<ProcessUse> postgresUse(const std::filesystem::path& pid_file) {
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(pid_file));
  const long first = std::strtol(text.c_str(), nullptr, 10);
  if (!parentOf(first))
    return Error{ErrorCode::kInvalidInput,
                 pid_file.string() + ": names no process of PostgreSQL that runs on this computer"};
  return useWithChildren(static_cast<pid_t>(first));
}

}  // namespace needlelab::test
