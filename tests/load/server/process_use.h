/// Resources used by a run's processes: server, PostgreSQL, its standby, NATS, the generator.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/store/connection.h"
#include "tests/operations/prometheus_text.h"

namespace needlelab::test {

/// Of one process, or of a server with its children. Unknown or missing values are empty.
struct ProcessUse {
  std::string name;             ///< "server a", "PostgreSQL", …
  std::optional<double> cpu_s;  ///< user and system
  /// Written to files: pages that became dirty, as counted by /proc/PID/io. More than a log's bytes, because
  /// a page written again after a sync counts again.
  std::optional<std::uint64_t> disk_bytes;
  std::optional<std::uint64_t> log_bytes;  ///< of PostgreSQL's log (WAL)
  /// For a server: to and from stations, viewers and NATS, without TLS. For PostgreSQL: its log to standbys;
  /// traffic with the servers is not counted. For NATS: the content of its messages.
  std::optional<std::uint64_t> sent_bytes, received_bytes;
  /// For a server: parsed messages, and live frames from stations or NATS; acknowledgements, and live frames
  /// to viewers or NATS. The servers' presence messages count only at NATS.
  std::optional<std::uint64_t> messages_out, messages_in;
};

/// The difference; empty where a number is unknown at either time, or smaller at the end (its process was
/// restarted).
ProcessUse useBetween(const ProcessUse& begin, const ProcessUse& end);

/// CPU and disk_bytes since it began; empty if there is no such process.
ProcessUse useOf(pid_t pid);
/// … including its children, also those that have ended.
ProcessUse useWithChildren(pid_t pid);

/// Adds bytes and messages from a server's metrics.
void addScrape(ProcessUse& use, const Scrape& scrape);
/// … from NATS's /varz.
void addVarz(ProcessUse& use, std::string_view json);

/// Of all processes of the PostgreSQL server, including those that have ended: `cpu_s` and `disk_bytes` are
/// empty if it does not run on this computer, `sent_bytes` if no standby follows. A standby's are not
/// included.
struct PostgresUse {
  ProcessUse use;
  std::uint64_t database_bytes = 0;  ///< of this database, tables and indexes
};
/// Since the cluster was created. Thread: the connection's. Errors: the database's.
Result<PostgresUse> postgresUse(Connection& connection);
/// By the postmaster.pid of a PostgreSQL server on this computer. Errors: kInvalidInput.
Result<ProcessUse> standbyUse(const std::filesystem::path& pid_file);

}  // namespace needlelab::test
