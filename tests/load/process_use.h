/// What a run's processes use: server, PostgreSQL, its standby, NATS, the generator.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"
#include "tests/operations/prometheus_text.h"

namespace needlelab::test {

/// Of one process, or of a server with its children. What is not known, or what it does not have, is nothing.
struct ProcessUse {
  std::string name;             ///< "server a", "PostgreSQL", …
  std::optional<double> cpu_s;  ///< user and system
  /// Written to files: pages that became dirty, as /proc/PID/io counts them. More than a log's bytes, because
  /// a page that is written again after a sync counts again.
  std::optional<std::uint64_t> disk_bytes;
  std::optional<std::uint64_t> log_bytes;  ///< of PostgreSQL's log (WAL)
  /// Of a server: to and from stations, viewers and NATS, without TLS. Of PostgreSQL: its log to standbys;
  /// what goes between it and the servers is not counted. Of NATS: what its messages hold.
  std::optional<std::uint64_t> sent_bytes, received_bytes;
  /// Of a server: what it parsed, and live frames, from stations or over NATS; acknowledgements, and live
  /// frames to viewers or to NATS. What servers say of their stations counts at NATS only.
  std::optional<std::uint64_t> messages_out, messages_in;
};

/// The difference; a number that is unknown at either time, or is less at the end (its process was started
/// again), is nothing.
ProcessUse useBetween(const ProcessUse& begin, const ProcessUse& end);

/// CPU and disk_bytes since it began; nothing of a process that is not there.
ProcessUse useOf(pid_t pid);
/// … of it, of its children, and of those that have ended.
ProcessUse useWithChildren(pid_t pid);

/// Bytes and messages as a server's metrics say.
void addScrape(ProcessUse& use, const Scrape& scrape);
/// … as NATS's /varz says.
void addVarz(ProcessUse& use, std::string_view json);

/// Of all processes of the server of PostgreSQL, those that have ended too: `cpu_s` and `disk_bytes` are
/// nothing where it does not run on this computer, `sent_bytes` where no standby follows. A standby's are not
/// in it.
struct PostgresUse {
  ProcessUse use;
  std::uint64_t database_bytes = 0;  ///< of this database, tables and indexes
};
/// Since the cluster was made. Thread: the connection's. Errors: those of the database.
Result<PostgresUse> postgresUse(Connection& connection);
/// By the postmaster.pid of a server of PostgreSQL on this computer. Errors: kInvalidInput.
Result<ProcessUse> standbyUse(const std::filesystem::path& pid_file);

}  // namespace needlelab::test
