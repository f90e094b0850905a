#include "db/store_copy.h"

#include <fmt/core.h>
#include <sqlite3.h>

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "db/acknowledged.h"
#include "db/copied_tables.h"
#include "db/schema.h"
#include "db/session_rows.h"

namespace needlelab {
namespace {

/// The log beside an SQLite copy is emptied above this: nothing else does it.
constexpr std::uint64_t kMostLogBytesOfCopy = std::uint64_t{64} << 20;
/// Rows between two calls of on_progress while comparing.
constexpr std::uint64_t kComparedRowsOfStep = 256;

/// Triggers of this connection to an SQLite file do not run meanwhile.
class WithoutTriggers {
 public:
  explicit WithoutTriggers(Connection& connection) : handle_(connection.handle()) { turn(0); }
  ~WithoutTriggers() { turn(1); }
  WithoutTriggers(const WithoutTriggers&) = delete;
  WithoutTriggers& operator=(const WithoutTriggers&) = delete;

 private:
  void turn(int on) {
    if (handle_ != nullptr) sqlite3_db_config(handle_, SQLITE_DBCONFIG_ENABLE_TRIGGER, on, nullptr);
  }
  sqlite3* handle_;  ///< null: not SQLite
};

/// A page's statement has a limit as a parameter: without it, a plan that sorts the whole table for each page
/// might be kept.
Status planEachTime(Connection& connection) {
  if (connection.sqlite() != nullptr) return {};
  return connection.script("SET plan_cache_mode = force_custom_plan");
}

Result<std::vector<CopiedTable>> tablesOfBoth(Connection& from, Connection& to) {
  for (Connection* one : {&from, &to}) {
    RETURN_IF_ERROR(requireNewestSchema(*one));
    RETURN_IF_ERROR(planEachTime(*one));
  }
  return copiedTables();
}

/// What is only one store's own.
bool isMark(const CopiedTable& table, const CopiedRow& row) {
  if (table.name != "meta") return false;
  const auto* key = std::get_if<std::string>(&row.front());
  return key != nullptr && (*key == kCopyMarkKey || *key == kCopiedToKey || isAcknowledgedKey(*key));
}

/// The rows of a table in the order of its keys, one after another, without marks.
class RowStream {
 public:
  RowStream(Connection& connection, const CopiedTable& table, std::size_t most_rows)
      : connection_(connection), table_(table), most_rows_(most_rows) {}
  /// Null: there are no more. Valid until the next call.
  Result<const CopiedRow*> next() {
    for (;;) {
      if (at_ == page_.size()) {
        if (ended_) return static_cast<const CopiedRow*>(nullptr);
        ASSIGN_OR_RETURN(page_, rowsBehind(connection_, table_, after_, most_rows_));
        at_ = 0;
        ended_ = page_.empty();
        if (ended_) continue;
        after_ = keyOf(table_, page_.back());
      }
      const CopiedRow* row = &page_[at_++];
      if (!isMark(table_, *row)) return row;
    }
  }

 private:
  Connection& connection_;
  const CopiedTable& table_;
  const std::size_t most_rows_;
  std::vector<CopiedRow> page_;
  std::size_t at_ = 0;
  bool ended_ = false;
  CopiedRow after_;
};

std::uint64_t chunkBytesOf(const CopiedTable& table, const CopiedRow& row) {
  if (!table.hasChunks()) return 0;
  const auto* bytes = std::get_if<std::string>(&row.back());
  return bytes != nullptr ? bytes->size() : 0;
}

Status tell(const CopyOptions& options, const CopyProgress& progress) {
  return options.on_progress ? options.on_progress(progress) : Status();
}

/// How many chunks there are, as the sessions count them; for progress only.
Result<std::uint64_t> chunksCounted(Connection& connection) {
  auto row = connection.prepare(
      "SELECT coalesce((SELECT sum(chunks) FROM sessions WHERE recording = 1), 0)"
      " + coalesce((SELECT sum(chunks) FROM session_progress), 0)");
  ASSIGN_OR_RETURN(const bool there, row.step());
  return there ? row.natural(0) : 0;
}

/// Copies behind what is there.
Status copyTable(Connection& from, Connection& to, const CopiedTable& table, const CopyOptions& options,
                 CopiedRows& copied) {
  CopyProgress progress{.table = table.name};
  if (table.name == "chunks") {
    ASSIGN_OR_RETURN(progress.of, chunksCounted(from));
  }
  ASSIGN_OR_RETURN(CopiedRow after, lastKeyOf(to, table));
  for (;;) {
    ASSIGN_OR_RETURN(const auto rows, rowsBehind(from, table, after, options.most_rows));
    if (rows.empty()) break;
    {
      ASSIGN_OR_RETURN(auto transaction, Transaction::begin(to, Transaction::Kind::kWrite));
      RETURN_IF_ERROR(addRows(to, table, rows));
      RETURN_IF_ERROR(transaction.commit());
    }
    if (to.walBytes() > kMostLogBytesOfCopy) {
      const auto emptied = to.emptyLog(0);
      if (!emptied) return emptied.error();
    }
    after = keyOf(table, rows.back());
    for (const CopiedRow& row : rows) copied.bytes += chunkBytesOf(table, row);
    copied.rows += rows.size();
    progress.rows += rows.size();
    if (table.hasChunks()) progress.bytes = copied.bytes;
    RETURN_IF_ERROR(tell(options, progress));
  }
  progress.table_ended = true;
  return tell(options, progress);
}

/// `meta` and the last numbers, whole: adding rows has changed the latter.
Status copyFacts(Connection& from, Connection& to, const CopiedTable& meta) {
  std::vector<CopiedRow> rows;
  RowStream stream(from, meta, SIZE_MAX);
  for (;;) {
    ASSIGN_OR_RETURN(const CopiedRow* row, stream.next());
    if (row == nullptr) break;
    rows.push_back(*row);
  }
  ASSIGN_OR_RETURN(const auto numbers, lastNumbersOf(from));
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(to, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(to.run("DELETE FROM meta WHERE key <> ?", kCopyMarkKey));
  RETURN_IF_ERROR(addRows(to, meta, rows));
  RETURN_IF_ERROR(setLastNumbers(to, numbers));
  return transaction.commit();
}

Error differs(const std::string& what, const char* how) {
  return {ErrorCode::kCorrupt,
          fmt::format("the copy is not as its source: table {} {}: somebody changed one of the two since it "
                      "was copied, or a disk did",
                      what, how)};
}

/// Computes the CRC of a chunk of the copy.
Status lookAtChunk(Connection& to, const CopiedTable& table, const CopiedRow& row, ComparedRows& compared) {
  const auto number = [&](std::size_t place) {
    const auto* value = std::get_if<std::int64_t>(&row[place]);
    return value != nullptr ? *value : 0;
  };
  const auto* bytes = std::get_if<std::string>(&row.back());
  ++compared.chunks;
  compared.bytes += chunkBytesOf(table, row);
  const auto session = number(0), seq = number(1);
  const auto sound = checkStoredChunk(fmt::format("{}, session {}", table.name, session),
                                      static_cast<std::uint64_t>(seq), static_cast<std::uint64_t>(number(2)),
                                      number(3), bytes != nullptr ? viewOf(*bytes) : ByteView());
  if (sound) return {};  // also one that cannot be decoded, but came as it is
  auto known = to.query("SELECT 1 FROM quarantined_chunks WHERE session = ? AND seq = ?", session, seq);
  ASSIGN_OR_RETURN(const bool is_known, known.step());
  if (is_known) {
    ++compared.known_damaged;
    return {};
  }
  ++compared.damaged_chunks;
  if (compared.damaged.size() < kMostDamagedNamed) {
    std::string named = sound.error().message;
    auto id = to.query("SELECT id FROM sessions WHERE number = ?", session);
    ASSIGN_OR_RETURN(const bool there, id.step());
    if (there) named += " (" + sessionText(textOf(id.bytes(0))) + ")";
    compared.damaged.push_back(std::move(named));
  }
  return {};
}

Status compareTable(Connection& from, Connection& to, const CopiedTable& table, const CopyOptions& options,
                    ComparedRows& compared) {
  CopyProgress progress{.comparing = true, .table = table.name};
  if (table.name == "chunks") {
    ASSIGN_OR_RETURN(progress.of, chunksCounted(from));
  }
  // before the first row is looked at, too
  RETURN_IF_ERROR(tell(options, progress));
  RowStream left(from, table, options.most_rows), right(to, table, options.most_rows);
  for (;;) {
    ASSIGN_OR_RETURN(const CopiedRow* source, left.next());
    ASSIGN_OR_RETURN(const CopiedRow* copy, right.next());
    if (source == nullptr && copy == nullptr) break;
    const bool lacks = copy == nullptr || (source != nullptr && keyOf(table, *source) < keyOf(table, *copy));
    if (lacks) return differs(rowText(table, keyOf(table, *source)), "is missing in the copy");
    if (source == nullptr || keyOf(table, *copy) < keyOf(table, *source))
      return differs(rowText(table, keyOf(table, *copy)), "is in the copy alone");
    if (const auto column = differingColumn(table, *source, *copy))
      return differs(rowText(table, keyOf(table, *copy)),
                     fmt::format("has another value in the column {}", *column).c_str());
    if (table.hasChunks()) RETURN_IF_ERROR(lookAtChunk(to, table, *copy, compared));
    ++compared.rows;
    if (table.hasChunks()) progress.bytes = compared.bytes;
    if (++progress.rows % kComparedRowsOfStep == 0) RETURN_IF_ERROR(tell(options, progress));
  }
  progress.table_ended = true;
  return tell(options, progress);
}

Status compareLastNumbers(Connection& from, Connection& to) {
  ASSIGN_OR_RETURN(const auto source, lastNumbersOf(from));
  ASSIGN_OR_RETURN(const auto copy, lastNumbersOf(to));
  if (source == copy) return {};
  return differs("of last numbers (sqlite_sequence, last_numbers)", "has other numbers");
}

/// Turns the triggers that are not PostgreSQL's own (foreign keys) off or on.
Status turnTriggers(Connection& to, bool on) {
  if (to.sqlite() != nullptr) return {};
  ASSIGN_OR_RETURN(const auto tables, copiedTables());
  for (const CopiedTable& table : tables) {
    const Status turned =
        to.script(fmt::format("ALTER TABLE \"{}\" {} TRIGGER USER", table.name, on ? "ENABLE" : "DISABLE"));
    if (!turned)
      return Error{turned.error().code,
                   turned.error().message +
                       "; a copy needs the user who owns the tables, that is, who made them: an empty "
                       "database, in which the user may make a schema"};
  }
  return {};
}

}  // namespace

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
  const WithoutTriggers without(to);
  CopiedRows copied;
  // `meta` is the last one
  for (const CopiedTable& table : std::span(tables).first(tables.size() - 1))
    RETURN_IF_ERROR(copyTable(from, to, table, options, copied));
  RETURN_IF_ERROR(copyFacts(from, to, tables.back()));
  return copied;
}

Result<ComparedRows> compareRows(Connection& from, Connection& to, const CopyOptions& options) {
  ASSIGN_OR_RETURN(const auto tables, tablesOfBoth(from, to));
  ComparedRows compared;
  for (const CopiedTable& table : tables) RETURN_IF_ERROR(compareTable(from, to, table, options, compared));
  RETURN_IF_ERROR(compareLastNumbers(from, to));
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
