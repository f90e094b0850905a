/// What differs between the SQL of SQLite, in which the stores are written, and PostgreSQL's:
/// - parameters: `?` and `?3` become `$1`, `$3`; NOT INDEXED goes (forPostgres(), here);
/// - the schema, and min(a, b), max(a, b), instr, hex and zeroblob, which are functions of it
///   (db/migrations/postgres);
/// - BEGIN, SAVEPOINT and COMMIT are the engines' own (engine.h).
/// Where the two do not do the same, a file asks which one it has (Connection::sqlite()). A test holds this
/// list. Other SQL have
/// - schema, check, connection: catalogues, versions, PRAGMA, the greatest number of a table;
/// - session_rows: a chunk is compared with its index entry by rowid, which PostgreSQL does itself;
/// - retention_store, erasure: the database's size and room, statistics that hold values;
/// - restored_backup: which server it is, and whether it is a standby;
/// - copied_tables, store_copy: last numbers, triggers, plans;
/// - people, session_results, text_lists: many rows in one statement, by lists as parameters;
/// - login_store: the database's clock, a lock of one table, rows that others have locked.
/// Without SQL differ db_writer and session_appends (chunks in one statement, who keeps what a failed COMMIT
/// had), session_reader and session_samples (a score's step reads by one view), erasure, erasures and
/// upkeep_handlers (files, pages and backups are PostgreSQL's own), monitor (where the size comes from).
///
/// What stores may not use, because only SQLite has it: a bare number as a condition (write `flag <> 0`),
/// bare columns beside an aggregate, a subquery in FROM without a name, GLOB, PRAGMA, rowid,
/// CAST(… AS INTEGER) (write BIGINT), last_insert_rowid (write RETURNING).
#pragma once

#include <string>
#include <string_view>

namespace needlelab {

struct PostgresSql {
  std::string text;
  int parameters = 0;  ///< the greatest number
};

/// The statement in PostgreSQL's form. A `?` gets the number after the greatest one so far, as in SQLite.
/// Texts ('…'), names ("…") and comments (-- …) stay as they are.
PostgresSql forPostgres(std::string_view sql);

}  // namespace needlelab
