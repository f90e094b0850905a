/// The schema's numbered forward migrations (db/migrations/NNNN_what.sql, embedded into the binary), and
/// facts about the database.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/program.h"
#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

/// Marks a file as a needlelab database (PRAGMA application_id): "nlab".
inline constexpr std::int64_t kApplicationId = 0x6e6c6162;

/// The version after all of this program's migrations.
int newestSchemaVersion();

/// The file's version (PRAGMA user_version), 0 or more; 0: empty file. kCorrupt: a damaged header.
Result<int> schemaVersion(Connection& connection);

/// Differences between the schema (tables, indexes, triggers, views; on PostgreSQL see
/// postgresSchemaFaults()) and what the migrations up to its version create: at most kMaxSchemaFaults
/// sentences; empty: none. ANALYZE's tables (sqlite_stat1, sqlite_stat4) are allowed if they are as SQLite
/// creates them. An attacker with one-time write access could leave a trigger that changes or swallows what
/// is stored later, with a valid proof of a false audit line. Takes milliseconds. Errors: kVersion (the file
/// is newer than this program), kCorrupt. Thread: as the connection.
Result<std::vector<std::string>> schemaFaults(Connection& connection);
inline constexpr std::size_t kMaxSchemaFaults = 20;

/// kDenied: the PostgreSQL role may not create the schema, or not use the existing one; the message tells an
/// administrator what to type. Reads nothing of the schema before. SQLite: no check. Needs a writer's
/// connection.
Status requireRights(Connection& connection);

/// Migrates the database to the newest version, one transaction per migration; a failure leaves the previous
/// version. Errors: kVersion (the file is newer than this program), kCorrupt (another program's database, or
/// schemaFaults() finds something), kFailed. Needs the writer's connection.
Status migrate(Connection& connection);
/// Same with the given files, for the connection's engine. Fails unless they are named NNNN_… with numbers 1,
/// 2, 3 … in order.
Status migrate(Connection& connection, std::span<const EmbeddedFile> migrations);

/// kVersion unless the file has exactly the newest version. For connections that must not change the file.
Status requireNewestSchema(Connection& connection);

/// db/migrations/*.sql, in order of their numbers.
std::span<const EmbeddedFile> embeddedMigrations();
/// db/samples/*.json: profiles and curricula for a new database. In needlelab::service.
std::span<const EmbeddedFile> embeddedSamples();

/// Facts about the database, by key: engine_version, created_unix_ns, backup_unix_ns, backup_path; the latest
/// time (seen_time.h); the lab's settings (LabSettingsStore). Does not own the connection. Thread: as its
/// Connection; set() needs the writer's.
class MetaStore {
 public:
  explicit MetaStore(Connection& connection) : connection_(connection) {}
  Status set(std::string_view key, std::string_view value);
  Result<std::optional<std::string>> get(std::string_view key);

 private:
  Connection& connection_;
};

// --- settings for the whole lab

/// Keys of `meta` that are settings: "1" or "0"; absent: "0". Included in exports.
inline constexpr std::string_view kCodesRequiredKey = "codes_required";
inline constexpr std::string_view kKeepErasedKey = "keep_recordings_of_erased";

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class LabSettingsStore {
 public:
  explicit LabSettingsStore(Connection& connection) : connection_(connection) {}

  /// Whether trainees without a code may practise only as kGuestName.
  Result<bool> codesRequired();
  Status setCodesRequired(bool required);
  /// Whether an erased person's sessions stay, without a name.
  Result<bool> keepsRecordingsOfErased();
  Status setKeepsRecordingsOfErased(bool keeps);

 private:
  Result<bool> is(std::string_view key);
  Status set(std::string_view key, bool value);
  Connection& connection_;
};

// --- PostgreSQL (db/migrations/postgres); private to schema.cpp, which chooses by the engine

/// db/migrations/postgres/*.sql, in order of their numbers.
std::span<const EmbeddedFile> embeddedPostgresMigrations();

/// 0: the database has no needlelab schema. kCorrupt: its table does not hold exactly one version.
Result<int> postgresSchemaVersion(Connection& connection);

/// Preconditions of a migration. kInvalidInput: the database's texts do not sort byte by byte. kDenied: as
/// requireOwnSchema().
Status requirePostgresForSchema(Connection& connection);
/// Migrates the schema from the previous version to `version` in one transaction; does nothing if another
/// server has done it meanwhile.
Status applyOnPostgres(Connection& connection, const EmbeddedFile& file, int version);

/// Like schemaFaults(), for a schema of the newest version: its triggers, functions, views, rules and row
/// policies; at most `most`. For views only checks that they exist.
Result<std::vector<std::string>> postgresSchemaFaults(Connection& connection, std::size_t most);

/// kDenied: the schema, or a table in it, exists and belongs to another role.
Status requireOwnSchema(Connection& connection);

/// As requireRights().
Status requirePostgresRights(Connection& connection);

}  // namespace needlelab
