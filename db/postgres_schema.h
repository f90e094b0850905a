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

/// db/migrations/postgres/*.sql, in order of their numbers: the first is that of a whole schema.
std::span<const EmbeddedFile> embeddedPostgresMigrations();

/// 0: the database has no schema of needlelab. kCorrupt: its table has something else than one version.
Result<int> postgresSchemaVersion(Connection& connection);

/// Makes the schema, or brings it to `newest`; one transaction a migration. kVersion: it is older than the
/// first one that there was on PostgreSQL. kDenied: as requireOwnSchema().
Status migratePostgres(Connection& connection, int found, int newest);

/// As schemaFaults(), of a schema of the newest version: its triggers, functions, views, rules and row
/// policies. Of a view only whether it is there.
Result<std::vector<std::string>> postgresSchemaFaults(Connection& connection);

/// kDenied: the schema, or a table in it, is there and belongs to another role.
Status requireOwnSchema(Connection& connection);

/// As requireRights().
Status requirePostgresRights(Connection& connection);

}  // namespace needlelab
