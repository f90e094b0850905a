/// The schema's numbered forward migrations (db/migrations/NNNN_what.sql, embedded into the binary), and
/// facts about the database itself.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/program.h"
#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Marks a file as ours (PRAGMA application_id): "nlab".
inline constexpr std::int64_t kApplicationId = 0x6e6c6162;

/// The version that this program's migrations lead to.
int newestSchemaVersion();

/// The file's version (PRAGMA user_version); 0 = empty file.
Result<int> schemaVersion(Connection& connection);

/// Brings the database to the newest version, each migration in a transaction of its own: a failure leaves
/// the version before it. Errors: kVersion (the file is newer than this program), kCorrupt (some other
/// program's database), kFailed. Writer's connection.
Status migrate(Connection& connection);
/// The same with given files; they must be named NNNN_… with numbers 1, 2, 3 … in order, or it
/// fails.
Status migrate(Connection& connection, std::span<const EmbeddedFile> migrations);

/// kVersion unless the file has exactly the newest version. For connections that must not change it.
Status requireNewestSchema(Connection& connection);

/// db/migrations/*.sql, in order of their numbers.
std::span<const EmbeddedFile> embeddedMigrations();
/// db/samples/*.json: profiles and curricula for a new database. In needlelab::service.
std::span<const EmbeddedFile> embeddedSamples();

/// Facts about the database itself, by key: engine_version, created_unix_ns, backup_unix_ns, backup_path.
/// Functions on a connection, which it does not own. Thread: as its Connection; set() needs the writer's.
class MetaStore {
 public:
  explicit MetaStore(Connection& connection) : connection_(connection) {}
  Status set(std::string_view key, std::string_view value);
  Result<std::optional<std::string>> get(std::string_view key);

 private:
  Connection& connection_;
};

}  // namespace needlelab
