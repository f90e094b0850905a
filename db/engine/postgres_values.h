/// PostgreSQL's form of statements and values: what SQL the stores may use; the binary formats of values (its
/// source: src/backend/utils/adt, functions *send and *recv).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/bytes.h"

namespace needlelab {

/// Differences between SQLite's SQL, in which the stores are written, and PostgreSQL's:
/// - parameters: `?` and `?3` become `$1`, `$3`; NOT INDEXED is dropped (forPostgres(), here);
/// - the schema; min(a, b), max(a, b), instr, hex and zeroblob are functions in it (db/migrations/postgres);
/// - BEGIN, SAVEPOINT and COMMIT are up to the engines (engine.h).
/// Where the two do not do the same, a file checks which engine it has (Connection::sqlite()). A test checks
/// this list; it finds it by the first words of this paragraph and of the next one. Files with
/// engine-specific SQL:
/// - schema, check, connection: catalogues, versions, PRAGMA, the greatest number of a table;
/// - session_rows: a chunk is matched to its index entry by rowid, which PostgreSQL does itself;
/// - retention_store, erasure: the database's size and free space, statistics that contain values;
/// - foreign_database: which server it is, and whether it is a standby;
/// - copied_tables, store_copy: last numbers, triggers, plans;
/// - people, session_results, rows: many rows in one statement, with lists as parameters;
/// - login_store: the database's clock, a table lock, rows locked by others.
/// Files with engine-specific code but no such SQL: db_writer and session_appends (chunks in one statement;
/// who keeps what a failed COMMIT had), session_reader and session_samples (a scoring step reads in one
/// view), erasure, erasures and upkeep_handlers (files, pages and backups are up to PostgreSQL), monitor
/// (where the size comes from).
///
/// What stores may not use, because only SQLite has it: a bare number as a condition (write `flag <> 0`),
/// bare columns beside an aggregate, an unnamed subquery in FROM, GLOB, PRAGMA, rowid, CAST(… AS INTEGER)
/// (write BIGINT), last_insert_rowid (write RETURNING).
struct PostgresSql {
  std::string text;
  int parameters = 0;  ///< the greatest number
};

/// The statement in PostgreSQL's form. A `?` gets the number after the greatest one so far, as in SQLite.
/// Texts ('…'), names ("…") and comments (-- …) are unchanged.
PostgresSql forPostgres(std::string_view sql);

/// Types by their OIDs (pg_type.dat).
enum class PostgresType : std::uint32_t {
  kUnspecified = 0,
  kBool = 16,
  kBytes = 17,
  kName = 19,
  kInt8 = 20,
  kInt2 = 21,
  kInt4 = 23,
  kText = 25,
  kOid = 26,
  kFloat4 = 700,
  kFloat8 = 701,
  kVarchar = 1043,
  kNumeric = 1700,
  kBytesList = 1001,  // arrays
  kTextList = 1009,
  kInt8List = 1016,
};

/// 8 bytes, big-endian.
std::string postgresInteger(std::int64_t value);
std::string postgresReal(double value);
/// A one-dimensional array (array_send). Nothing if it would exceed PostgreSQL's limit of 1 GiB.
std::optional<std::string> postgresList(std::span<const std::int64_t> values);
std::optional<std::string> postgresList(std::span<const std::string_view> values);
std::optional<std::string> postgresList(std::span<const ByteView> values);

/// The value as an integer, as SQLite would convert it: the leading number of a text; the integral part of a
/// numeric or real, clamped to 64 bits; 0 for anything else. `bytes` come from a server and may have any
/// length.
std::int64_t integerOfPostgres(PostgresType type, ByteView bytes);
/// The value as a real number, likewise.
double realOfPostgres(PostgresType type, ByteView bytes);
/// The digits of a number, as SQLite would convert it to text. Nothing: `bytes` already are the text or
/// bytes.
std::optional<std::string> textOfPostgres(PostgresType type, ByteView bytes);

}  // namespace needlelab
