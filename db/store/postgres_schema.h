/// Schema versions on PostgreSQL (db/migrations/postgres). Private to schema.cpp, which chooses by the
/// connection's engine.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "common/base/program.h"
#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

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
