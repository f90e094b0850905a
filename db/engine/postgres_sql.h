/// What differs between the SQL of SQLite, in which the stores are written, and PostgreSQL's. All of it is
/// here and in db/migrations/postgres:
/// - parameters: `?` and `?3` become `$1`, `$3`; NOT INDEXED goes (forPostgres());
/// - min(a, b), max(a, b), instr, hex and zeroblob are functions of the schema there;
/// - BEGIN, SAVEPOINT and COMMIT are the engines' own (engine.h).
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
