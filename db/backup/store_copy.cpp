#include "db/backup/store_copy.h"

#include <fmt/core.h>
#include <sqlite3.h>

#include <span>
#include <utility>
#include <vector>

#include "db/backup/copied_tables.h"
#include "db/sessions/acknowledged.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

/// The log beside an SQLite copy is emptied above this size; nothing else empties it.
constexpr std::uint64_t kMaxLogBytesOfCopy = std::uint64_t{64} << 20;

constexpr std::string_view kCopyingWord = "copying ", kComparedWord = "compared ";

/// A key of `meta`, if there is a schema.
Result<std::optional<std::string>> metaOfAny(Connection& connection, std::string_view key) {
  ASSIGN_OR_RETURN(const int version, schemaVersion(connection));
  if (version == 0) return std::optional<std::string>();
  return MetaStore(connection).get(key);
}

Result<std::vector<CopiedTable>> tablesOfBoth(Connection& from, Connection& to) {
  for (Connection* one : {&from, &to}) {
    RETURN_IF_ERROR(requireNewestSchema(*one));
    // a generic plan for any limit might sort the whole table for each page
    if (one->sqlite() == nullptr) RETURN_IF_ERROR(one->script("SET plan_cache_mode = force_custom_plan"));
  }
  return copiedTables();
}

/// Whether the row belongs to one store only and is not copied.
bool isMark(const CopiedTable& table, const CopiedRow& row) {
  if (table.name != "meta") return false;
  const auto* key = std::get_if<std::string>(&row.front());
  return key != nullptr && (*key == kCopyMarkKey || *key == kCopiedToKey || isAcknowledgedKey(*key));
}

/// A table's rows in key order, without marks.
class RowStream {
 public:
  RowStream(Connection& connection, const CopiedTable& table, std::size_t max_rows)
      : connection_(connection), table_(table), max_rows_(max_rows) {}
  /// Null at the end. Valid until the next call.
  Result<const CopiedRow*> next() {
    for (;;) {
      if (at_ == page_.size()) {
        ASSIGN_OR_RETURN(page_, rowsBehind(connection_, table_, after_, max_rows_));
        at_ = 0;
        if (page_.empty()) return static_cast<const CopiedRow*>(nullptr);
        after_ = keyOf(table_, page_.back());
      }
      const CopiedRow* row = &page_[at_++];
      if (!isMark(table_, *row)) return row;
    }
  }

 private:
  Connection& connection_;
  const CopiedTable& table_;
  const std::size_t max_rows_;
  std::vector<CopiedRow> page_;
  std::size_t at_ = 0;
  CopiedRow after_;
};

void count(const CopiedTable& table, const CopiedRow& row, CopiedRows& counted, CopyProgress& progress) {
  ++counted.rows;
  ++progress.rows;
  if (!table.hasChunks()) return;
  ++counted.chunks;
  if (const auto* bytes = std::get_if<std::string>(&row.back())) counted.bytes += bytes->size();
  progress.bytes = counted.bytes;
}

Status tell(const CopyOptions& options, const CopyProgress& progress) {
  return options.on_progress ? options.on_progress(progress) : Status();
}

Status addPage(Connection& to, const CopiedTable& table, std::span<const CopiedRow> rows) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(to, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(addRows(to, table, rows));
  return transaction.commit();
}

/// Continues after the last copied row.
Status copyTable(Connection& from, Connection& to, const CopiedTable& table, const CopyOptions& options,
                 CopiedRows& copied) {
  CopyProgress progress{.table = table.name};
  ASSIGN_OR_RETURN(CopiedRow after, lastKeyOf(to, table));
  for (;;) {
    ASSIGN_OR_RETURN(const auto rows, rowsBehind(from, table, after, options.max_rows));
    if (rows.empty()) break;
    if (const Status added = addPage(to, table, rows); !added) {
      if (added.error().code == ErrorCode::kUnavailable) return added;  // the connection is lost
      // one at a time, so that the message names the rejected row
      for (const CopiedRow& row : rows)
        if (const Status one = addPage(to, table, std::span(&row, 1)); !one)
          return Error{one.error().code,
                       fmt::format("table {}: {}", rowText(table, row), one.error().message)};
    }
    if (to.walBytes() > kMaxLogBytesOfCopy) {
      const auto emptied = to.emptyLog(0);
      if (!emptied) return emptied.error();
    }
    after = keyOf(table, rows.back());
    for (const CopiedRow& row : rows) count(table, row, copied, progress);
    RETURN_IF_ERROR(tell(options, progress));
  }
  progress.table_ended = true;
  return tell(options, progress);
}

/// Copies all of `meta` and the last numbers; adding rows has changed the latter.
Status copyFacts(Connection& from, Connection& to, const CopiedTable& meta) {
  ASSIGN_OR_RETURN(const auto numbers, lastNumbersOf(from));
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(to, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(to.run("DELETE FROM meta WHERE key <> ?", kCopyMarkKey));
  RowStream stream(from, meta, SIZE_MAX);
  for (;;) {
    ASSIGN_OR_RETURN(const CopiedRow* row, stream.next());
    if (row == nullptr) break;
    RETURN_IF_ERROR(addRows(to, meta, std::span(row, 1)));
  }
  RETURN_IF_ERROR(setLastNumbers(to, numbers));
  return transaction.commit();
}

Error differs(const std::string& what, const std::string& how) {
  return {ErrorCode::kCorrupt,
          fmt::format("the copy is not as its source: table {} {}: somebody changed one of the two since it "
                      "was copied, or a disk did",
                      what, how)};
}

Status compareTable(Connection& from, Connection& to, const CopiedTable& table, const CopyOptions& options,
                    CopiedRows& compared) {
  CopyProgress progress{.comparing = true, .table = table.name};
  // also reported before the first row is compared
  RETURN_IF_ERROR(tell(options, progress));
  RowStream left(from, table, options.max_rows), right(to, table, options.max_rows);
  for (;;) {
    ASSIGN_OR_RETURN(const CopiedRow* source, left.next());
    ASSIGN_OR_RETURN(const CopiedRow* copy, right.next());
    if (source == nullptr && copy == nullptr) break;
    if (copy == nullptr || (source != nullptr && keyOf(table, *source) < keyOf(table, *copy)))
      return differs(rowText(table, *source), "is missing in the copy");
    if (source == nullptr || keyOf(table, *copy) < keyOf(table, *source))
      return differs(rowText(table, *copy), "is in the copy alone");
    for (std::size_t i = 0; i < table.columns.size(); ++i)
      if ((*source)[i] != (*copy)[i])
        return differs(rowText(table, *copy), "has another value in the column " + table.columns[i].name);
    count(table, *copy, compared, progress);
    if (progress.rows % kMaxRowsOfPage == 0) RETURN_IF_ERROR(tell(options, progress));
  }
  progress.table_ended = true;
  return tell(options, progress);
}

/// Turns the triggers off or on, except PostgreSQL's own (foreign keys).
Status turnTriggers(Connection& to, bool on) {
  if (sqlite3* const handle = to.handle(); handle != nullptr) {
    sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_TRIGGER, on ? 1 : 0, nullptr);
    return {};
  }
  ASSIGN_OR_RETURN(const auto tables, copiedTables());
  for (const CopiedTable& table : tables)
    RETURN_IF_ERROR(
        to.script(fmt::format("ALTER TABLE \"{}\" {} TRIGGER USER", table.name, on ? "ENABLE" : "DISABLE")));
  return {};
}

}  // namespace

Result<std::optional<CopyMark>> readCopyMark(Connection& connection) {
  ASSIGN_OR_RETURN(const auto text, metaOfAny(connection, kCopyMarkKey));
  if (!text) return std::optional<CopyMark>();
  return std::optional(CopyMark{text->substr(text->find(' ') + 1), text->starts_with(kComparedWord)});
}

Status writeCopyMark(Connection& connection, const CopyMark& mark) {
  return MetaStore(connection)
      .set(kCopyMarkKey, std::string(mark.compared ? kComparedWord : kCopyingWord) + mark.id);
}

Result<std::optional<std::string>> copyBegunOf(Connection& connection) {
  return metaOfAny(connection, kCopiedToKey);
}

Status refuseUnfinishedCopy(Connection& connection) {
  ASSIGN_OR_RETURN(const auto mark, readCopyMark(connection));
  if (!mark || mark->compared) return {};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("{}: this database is an unfinished copy of another one: give the command "
                           "needlelab-admin store copy again, which resumes where it stopped; until then the "
                           "lab works with the database that is copied",
                           connection.sqlite() != nullptr ? connection.origin().string() : "--store")};
}

Status leaveCopyMarks(Connection& connection) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(connection.run("DELETE FROM meta WHERE key = ? OR key = ?", kCopyMarkKey, kCopiedToKey));
  return transaction.commit();
}

Result<bool> isEmptyStore(Connection& connection) {
  ASSIGN_OR_RETURN(const auto tables, copiedTables());
  for (const CopiedTable& table : tables) {
    auto row = connection.prepare(fmt::format("SELECT 1 FROM \"{}\" LIMIT 1", table.name));
    ASSIGN_OR_RETURN(const bool there, row.step());
    if (there) return false;
  }
  return true;
}

Status beginCopy(Connection& to, const CopyMark& mark) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(to, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(turnTriggers(to, false));
  RETURN_IF_ERROR(writeCopyMark(to, mark));
  return transaction.commit();
}

Result<CopiedRows> copyRows(Connection& from, Connection& to, const CopyOptions& options) {
  ASSIGN_OR_RETURN(const auto tables, tablesOfBoth(from, to));
  CopiedRows copied;
  // `meta` is last
  for (const CopiedTable& table : std::span(tables).first(tables.size() - 1))
    RETURN_IF_ERROR(copyTable(from, to, table, options, copied));
  RETURN_IF_ERROR(copyFacts(from, to, tables.back()));
  return copied;
}

Result<CopiedRows> compareRows(Connection& from, Connection& to, const CopyOptions& options) {
  ASSIGN_OR_RETURN(const auto tables, tablesOfBoth(from, to));
  CopiedRows compared;
  for (const CopiedTable& table : tables) RETURN_IF_ERROR(compareTable(from, to, table, options, compared));
  ASSIGN_OR_RETURN(const auto source, lastNumbersOf(from));
  ASSIGN_OR_RETURN(const auto copy, lastNumbersOf(to));
  if (source != copy) return differs("of last numbers (sqlite_sequence, last_numbers)", "has other numbers");
  return compared;
}

Status endCopy(Connection& to, CopyMark mark) {
  mark.compared = true;
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(to, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(turnTriggers(to, true));
  RETURN_IF_ERROR(writeCopyMark(to, mark));
  return transaction.commit();
}

Status emptyCopy(Connection& to) {
  ASSIGN_OR_RETURN(const auto tables, copiedTables());
  std::string names = "last_numbers";
  for (const CopiedTable& table : tables) names += fmt::format(", \"{}\"", table.name);
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(to, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(turnTriggers(to, true));
  RETURN_IF_ERROR(to.script("TRUNCATE " + names));
  return transaction.commit();
}

}  // namespace needlelab
