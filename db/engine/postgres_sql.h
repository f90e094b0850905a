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
/// - restored_backup: which server it is, and whether it is a standby;
/// - copied_tables, store_copy: last numbers, triggers, plans;
/// - people, session_results, text_lists: many rows in one statement, with lists as parameters;
/// - login_store: the database's clock, a table lock, rows locked by others.
/// Files with engine-specific code but no such SQL: db_writer and session_appends (chunks in one statement;
/// who keeps what a failed COMMIT had), session_reader and session_samples (a scoring step reads in one
/// view), erasure, erasures and upkeep_handlers (files, pages and backups are up to PostgreSQL), monitor
/// (where the size comes from).
///
/// What stores may not use, because only SQLite has it: a bare number as a condition (write `flag <> 0`),
/// bare columns beside an aggregate, an unnamed subquery in FROM, GLOB, PRAGMA, rowid, CAST(… AS INTEGER)
/// (write BIGINT), last_insert_rowid (write RETURNING).
#pragma once

#include <string>
#include <string_view>

namespace needlelab {

struct PostgresSql {
  std::string text;
  int parameters = 0;  ///< the greatest number
};

/// The statement in PostgreSQL's form. A `?` gets the number after the greatest one so far, as in SQLite.
/// Texts ('…'), names ("…") and comments (-- …) are unchanged.
PostgresSql forPostgres(std::string_view sql);

}  // namespace needlelab
