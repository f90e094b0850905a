#include "db/store/schema.h"

#include <fmt/core.h>

#include <cstdint>
#include <string>

namespace needlelab {
namespace {

constexpr std::int64_t kMaxVersion = 9'999;  // as many digits as file names have

/// Texts must be compared and case-folded byte by byte, as in SQLite.
Status requirePlainTexts(Connection& connection) {
  auto row = connection.prepare(
      "SELECT pg_encoding_to_char(encoding), datcollate, datctype, datname FROM pg_database"
      " WHERE datname = current_database()");
  ASSIGN_OR_RETURN(const bool there, row.step());
  if (there && row.text(0) == "UTF8" && row.text(1) == "C" && row.text(2) == "C") return {};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("--store: the database {0} has the encoding {1} and sorts by {2} ({3}), needlelab "
                           "needs UTF8 and C: create it again with CREATE DATABASE {0} TEMPLATE template0 "
                           "ENCODING 'UTF8' LC_COLLATE 'C' LC_CTYPE 'C'",
                           row.text(3), row.text(0), row.text(1), row.text(2))};
}

}  // namespace

Result<int> postgresSchemaVersion(Connection& connection) {
  ASSIGN_OR_RETURN(const auto there,
                   connection.prepare("SELECT to_regclass('needlelab.schema_version') IS NOT NULL")
                       .first([](const Statement& row) { return row.integer(0) != 0; }));
  if (!there.value_or(false)) return 0;
  ASSIGN_OR_RETURN(const auto versions, connection.prepare("SELECT version FROM schema_version LIMIT 2")
                                            .all([](const Statement& row) { return row.integer(0); }));
  if (versions.size() == 1 && versions.front() > 0 && versions.front() <= kMaxVersion)
    return static_cast<int>(versions.front());
  return Error{ErrorCode::kCorrupt,
               fmt::format("--store: the table schema_version of the schema needlelab has {}, and not one "
                           "version: somebody changed it. Find out who, and restore a backup",
                           versions.empty()       ? "no row"
                           : versions.size() == 1 ? std::to_string(versions.front())
                                                  : "several rows")};
}

Status requirePostgresForSchema(Connection& connection) {
  RETURN_IF_ERROR(requirePlainTexts(connection));
  return requireOwnSchema(connection);
}

Status applyOnPostgres(Connection& connection, const EmbeddedFile& file, int version) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  ASSIGN_OR_RETURN(const int found, postgresSchemaVersion(connection));
  if (found >= version) return {};
  if (found == 0) {
    // not IF NOT EXISTS, which requires the right to create one even if it exists
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

}  // namespace needlelab
