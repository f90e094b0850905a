/// The schema's versions on PostgreSQL (db/migrations/postgres). Private to schema.cpp, which chooses by the
/// connection's engine.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/base/program.h"
#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// db/migrations/postgres/*.sql, in order of their numbers.
std::span<const EmbeddedFile> embeddedPostgresMigrations();

/// 0: the database has no schema of needlelab. kCorrupt: its table has something else than one version.
Result<int> postgresSchemaVersion(Connection& connection);

/// What must hold before a migration. kInvalidInput: the database's texts do not sort byte by byte. kDenied:
/// as requireOwnSchema().
Status requirePostgresForSchema(Connection& connection);
/// Brings the schema from the version before to `version`, in one transaction; nothing to do where another
/// server did it meanwhile.
Status applyOnPostgres(Connection& connection, const EmbeddedFile& file, int version);

/// As schemaFaults(), of a schema of the newest version: its triggers, functions, views, rules and row
/// policies. Of a view only whether it is there.
Result<std::vector<std::string>> postgresSchemaFaults(Connection& connection);

/// kDenied: the schema, or a table in it, is there and belongs to another role.
Status requireOwnSchema(Connection& connection);

/// As requireRights().
Status requirePostgresRights(Connection& connection);

}  // namespace needlelab
