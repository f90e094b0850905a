#include "db/schema.h"

#include <fmt/core.h>

#include <charconv>
#include <string>

#include "db/connection.h"

namespace needlelab {
namespace {

Result<std::int64_t> oneInteger(Connection& connection, std::string_view sql) {
  Statement statement = connection.prepare(sql);
  ASSIGN_OR_RETURN(const bool row, statement.step());
  return row ? statement.integer(0) : 0;
}

/// The number at the start of a migration's name; -1 when there is none.
int numberOf(std::string_view name) {
  int number = -1;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return error == std::errc() && end == name.data() + 4 ? number : -1;
}

Error newerError(const Connection& connection, int found, int known) {
  return {ErrorCode::kVersion,
          fmt::format("{}: its schema has version {}, this program (needlelab " NEEDLELAB_VERSION
                      ") knows versions up to {}: use the newer program, or restore a backup",
                      connection.origin().string(), found, known)};
}

/// Marks a new file as a needlelab database; refuses another program's file.
Status claim(Connection& connection, int version) {
  ASSIGN_OR_RETURN(const auto id, oneInteger(connection, "PRAGMA application_id"));
  if (id == kApplicationId) return {};
  ASSIGN_OR_RETURN(const auto tables, oneInteger(connection, "SELECT count(*) FROM sqlite_schema"));
  if (id != 0 || version != 0 || tables != 0) {
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("{}: this is a database of another program (application_id {}): choose another folder",
                    connection.origin().string(), id)};
  }
  return connection.script(fmt::format("PRAGMA application_id={}", kApplicationId));
}

}  // namespace

int newestSchemaVersion() {
  return static_cast<int>(embeddedMigrations().size());
}

Result<int> schemaVersion(Connection& connection) {
  ASSIGN_OR_RETURN(const auto version, oneInteger(connection, "PRAGMA user_version"));
  if (version < 0)
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: its header says schema version {}, which no program writes: the file is "
                             "damaged; restore a backup",
                             connection.origin().string(), version)};
  return static_cast<int>(version);
}

Status migrate(Connection& connection) {
  return migrate(connection, embeddedMigrations());
}

Status migrate(Connection& connection, std::span<const EmbeddedFile> migrations) {
  ASSIGN_OR_RETURN(const auto found, schemaVersion(connection));
  const int known = static_cast<int>(migrations.size());
  RETURN_IF_ERROR(claim(connection, found));
  if (found > known) return newerError(connection, found, known);

  for (int version = found + 1; version <= known; ++version) {
    const EmbeddedFile& file = migrations[static_cast<std::size_t>(version - 1)];
    const auto named = [&](const Error& error) {
      return Error{error.code, fmt::format("migration {} failed, the database stays at version {}: {}",
                                           file.name, version - 1, error.message)};
    };
    if (numberOf(file.name) != version) {
      return named({ErrorCode::kFailed,
                    fmt::format("its name must begin with the number {} in four digits", version)});
    }
    auto transaction = Transaction::begin(connection, Transaction::Kind::kWrite);
    if (!transaction) return named(transaction.error());
    if (auto done = connection.script(std::string(file.text)); !done) return named(done.error());
    if (auto done = connection.script(fmt::format("PRAGMA user_version={}", version)); !done)
      return named(done.error());
    if (auto done = transaction->commit(); !done) return named(done.error());
  }
  return {};
}

Status requireNewestSchema(Connection& connection) {
  ASSIGN_OR_RETURN(const auto found, schemaVersion(connection));
  if (found > newestSchemaVersion()) return newerError(connection, found, newestSchemaVersion());
  if (found < newestSchemaVersion()) {
    return Error{ErrorCode::kVersion,
                 fmt::format("{}: its schema has version {}, wanted is {}: start "
                             "needlelab-server on it once, which migrates it",
                             connection.origin().string(), found, newestSchemaVersion())};
  }
  return {};
}

Status MetaStore::set(std::string_view key, std::string_view value) {
  return connection_.run(
      "INSERT INTO meta (key, value) VALUES (?,?) ON CONFLICT (key) DO UPDATE SET value = excluded.value",
      key, value);
}

Result<std::optional<std::string>> MetaStore::get(std::string_view key) {
  return connection_.query("SELECT value FROM meta WHERE key = ?", key).first(firstText);
}

}  // namespace needlelab
