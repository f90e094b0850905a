/// The schema's numbered forward migrations (db/migrations/NNNN_what.sql, embedded into the binary), and
/// facts about the database.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/program.h"
#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Marks a file as a needlelab database (PRAGMA application_id): "nlab".
inline constexpr std::int64_t kApplicationId = 0x6e6c6162;

/// The version after all of this program's migrations.
int newestSchemaVersion();

/// The file's version (PRAGMA user_version), 0 or more; 0 = empty file. kCorrupt: a damaged header.
Result<int> schemaVersion(Connection& connection);

/// What of the schema (tables, indexes, triggers, views; on PostgreSQL as postgresSchemaFaults() tells) is
/// not as the migrations up to its version make it, at most kMaxSchemaFaults sentences; empty: nothing. The
/// tables of an ANALYZE (sqlite_stat1, sqlite_stat4) are none, if they are as SQLite makes them. Somebody who
/// can write the file once could leave a trigger that changes or swallows what is stored later, with a right
/// proof of a wrong audit line. A time of milliseconds. Errors: kVersion (the file is newer than this
/// program), kCorrupt. Thread: as the connection.
Result<std::vector<std::string>> schemaFaults(Connection& connection);
inline constexpr std::size_t kMaxSchemaFaults = 20;

/// kDenied, before anything of the schema is read: the role of PostgreSQL may not make it, or not use what is
/// there; the message has what an administrator of PostgreSQL types. SQLite: nothing. A writer's connection.
Status requireRights(Connection& connection);

/// Migrates the database to the newest version, one transaction per migration: a failure leaves the previous
/// version. Errors: kVersion (the file is newer than this program), kCorrupt (another program's database, or
/// schemaFaults() finds something), kFailed. Writer's connection.
Status migrate(Connection& connection);
/// The same with the given files, of the connection's engine; fails unless they are named NNNN_… with numbers
/// 1, 2, 3 … in order.
Status migrate(Connection& connection, std::span<const EmbeddedFile> migrations);

/// kVersion unless the file has exactly the newest version. For connections that must not change the file.
Status requireNewestSchema(Connection& connection);

/// db/migrations/*.sql, in order of their numbers.
std::span<const EmbeddedFile> embeddedMigrations();
/// db/samples/*.json: profiles and curricula for a new database. In needlelab::service.
std::span<const EmbeddedFile> embeddedSamples();

/// Facts about the database, by key: engine_version, created_unix_ns, backup_unix_ns, backup_path; the latest
/// time (seen_time.h); and the lab's settings (lab_settings.h). Does not own the connection. Thread: as its
/// Connection; set() needs the writer's.
class MetaStore {
 public:
  explicit MetaStore(Connection& connection) : connection_(connection) {}
  Status set(std::string_view key, std::string_view value);
  Result<std::optional<std::string>> get(std::string_view key);

 private:
  Connection& connection_;
};

}  // namespace needlelab
