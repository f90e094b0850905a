#include "db/postgres_schema.h"

#include <fmt/core.h>

#include <charconv>
#include <cstdint>
#include <string>

#include "db/schema.h"

namespace needlelab {
namespace {

constexpr std::int64_t kMostVersion = 9'999;  // as many as names of files have numbers

/// The number at the start of a migration's name.
int versionOf(std::string_view name) {
  int number = 0;
  (void)std::from_chars(name.data(), name.data() + name.size(), number);
  return number;
}

/// Texts must compare and be folded byte by byte, as SQLite's.
Status requirePlainTexts(Connection& connection) {
  auto row = connection.prepare(
      "SELECT pg_encoding_to_char(encoding), datcollate, datctype, datname FROM pg_database"
      " WHERE datname = current_database()");
  ASSIGN_OR_RETURN(const bool there, row.step());
  if (there && row.text(0) == "UTF8" && row.text(1) == "C" && row.text(2) == "C") return {};
  return Error{
      ErrorCode::kInvalidInput,
      fmt::format("--store: the database {0} has the encoding {1} and sorts by {2} ({3}), needlelab needs "
                  "UTF8 and C: make it anew with CREATE DATABASE {0} TEMPLATE template0 ENCODING 'UTF8' "
                  "LC_COLLATE 'C' LC_CTYPE 'C'",
                  row.text(3), row.text(0), row.text(1), row.text(2))};
}

Status apply(Connection& connection, const EmbeddedFile& file, int version) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  // another server may have done it while this one waited
  ASSIGN_OR_RETURN(const int found, postgresSchemaVersion(connection));
  if (found >= version) return {};
  if (found == 0) {
    // not IF NOT EXISTS, which wants the right to make one also where it is there
    ASSIGN_OR_RETURN(const auto there,
                     connection.prepare("SELECT count(*) FROM pg_namespace WHERE nspname = 'needlelab'")
                         .first([](const Statement& row) { return row.integer(0) != 0; }));
    if (!there.value_or(false)) RETURN_IF_ERROR(connection.script("CREATE SCHEMA needlelab"));
    RETURN_IF_ERROR(connection.script("CREATE TABLE schema_version (version BIGINT NOT NULL)"));
  }
  RETURN_IF_ERROR(connection.script(std::string(file.text)));
  RETURN_IF_ERROR(connection.script("DELETE FROM schema_version"));
  RETURN_IF_ERROR(connection.run("INSERT INTO schema_version (version) VALUES (?)", version));
  return transaction.commit();
}

}  // namespace

Result<int> postgresSchemaVersion(Connection& connection) {
  ASSIGN_OR_RETURN(const auto there,
                   connection.prepare("SELECT to_regclass('needlelab.schema_version') IS NOT NULL")
                       .first([](const Statement& row) { return row.integer(0) != 0; }));
  if (!there.value_or(false)) return 0;
  ASSIGN_OR_RETURN(const auto versions, connection.prepare("SELECT version FROM schema_version LIMIT 2")
                                            .all([](const Statement& row) { return row.integer(0); }));
  if (versions.size() == 1 && versions.front() > 0 && versions.front() <= kMostVersion)
    return static_cast<int>(versions.front());
  return Error{ErrorCode::kCorrupt,
               fmt::format("--store: the table schema_version of the schema needlelab has {}, and not one "
                           "version: somebody changed it. Find out who, and restore a backup",
                           versions.empty()       ? "no row"
                           : versions.size() == 1 ? std::to_string(versions.front())
                                                  : "several rows")};
}

Status migratePostgres(Connection& connection, int found, int newest) {
  RETURN_IF_ERROR(requirePlainTexts(connection));
  RETURN_IF_ERROR(requireOwnSchema(connection));
  const int first = versionOf(embeddedPostgresMigrations().front().name);
  if (found > 0 && found < first)
    return Error{ErrorCode::kVersion,
                 fmt::format("--store: its schema has version {}, and the first one on PostgreSQL was {}: no "
                             "needlelab can have made it. Find out who did, or give another database",
                             found, first)};
  for (const EmbeddedFile& file : embeddedPostgresMigrations()) {
    const int version = versionOf(file.name);
    if (version <= found || version > newest) continue;
    if (const Status applied = apply(connection, file, version); !applied)
      return Error{applied.error().code,
                   fmt::format("migration {} failed, the database stays at version {}: {}", file.name, found,
                               applied.error().message)};
    found = version;
  }
  return {};
}

}  // namespace needlelab
