#include "db/rewrite.h"

#include <fmt/core.h>

#include <string>

namespace needlelab {
namespace {

/// Turns foreign keys and triggers off for a while; PRAGMA foreign_keys cannot do so within a transaction.
/// With them, SQLite deletes row by row and leaves the root page's free part as it was.
class RulesOff {
 public:
  explicit RulesOff(Connection& connection) : handle_(connection.handle()) { set(0); }
  ~RulesOff() { set(1); }
  RulesOff(const RulesOff&) = delete;
  RulesOff& operator=(const RulesOff&) = delete;

 private:
  void set(int on) const {
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_ENABLE_FKEY, on, nullptr);
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_ENABLE_TRIGGER, on, nullptr);
  }
  sqlite3* handle_;
};

}  // namespace

Status rewriteTables(Connection& writer, std::span<const std::string_view> tables) {
  const RulesOff off(writer);
  for (const std::string_view table : tables) {
    RETURN_IF_ERROR(writer.script("DROP TABLE IF EXISTS temp.rewritten"));
    RETURN_IF_ERROR(
        writer.script(fmt::format("CREATE TEMP TABLE rewritten AS SELECT * FROM main.{}", table)));
    RETURN_IF_ERROR(writer.script(fmt::format("DELETE FROM main.{}", table)));
    RETURN_IF_ERROR(writer.script(fmt::format("INSERT INTO main.{} SELECT * FROM temp.rewritten", table)));
    auto rows = writer.prepare(
        fmt::format("SELECT (SELECT count(*) FROM temp.rewritten) - (SELECT count(*) FROM main.{})", table));
    RETURN_IF_ERROR(rows.step());
    if (rows.integer(0) != 0)
      return Error{ErrorCode::kCorrupt,
                   fmt::format("the table {} has {} rows fewer after it was rewritten: nothing was changed; "
                               "run needlelab-admin check",
                               table, rows.integer(0))};
    // ends the query, which would lock the copy
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (more) return Error{ErrorCode::kFailed, "a count has more than one row"};
    RETURN_IF_ERROR(writer.script("DROP TABLE temp.rewritten"));
  }
  return {};
}

}  // namespace needlelab
