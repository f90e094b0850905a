/// RAII wrappers of SQLite: Statement, Connection, transactions and savepoints that roll back unless
/// committed, and CancelScope, which interrupts long reads. Errors are values.
#pragma once

#include <sqlite3.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/time_source.h"

namespace needlelab {

class Connection;
class Statement;

/// The value type of a row function's return type: T for both T and Result<T>.
template <typename T>
struct ValueOf {
  using Type = T;
};
template <typename T>
struct ValueOf<Result<T>> {
  using Type = T;
};
template <typename Make>
using MadeBy = typename ValueOf<std::invoke_result_t<const Make&, const Statement&>>::Type;

/// One execution of a prepared statement. The destructor returns the statement to its connection's cache. A
/// failure to prepare or to bind is stored and reported by the next step(), so callers check in one place.
/// Thread: not thread-safe; use it on its Connection's thread and destroy it before the Connection.
class Statement {
 public:
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&&) = delete;
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement();

  /// Binds the next parameter ("?"), left to right. Copies texts and bytes.
  Statement& bind(std::int64_t value);
  Statement& bind(std::uint64_t value);  ///< above 2^63 − 1: an error, SQLite has no such integers
  Statement& bind(std::int32_t value) { return bind(static_cast<std::int64_t>(value)); }
  Statement& bind(std::uint32_t value) { return bind(static_cast<std::int64_t>(value)); }
  Statement& bind(bool value) { return bind(static_cast<std::int64_t>(value ? 1 : 0)); }
  Statement& bind(double value);
  Statement& bind(std::string_view value);
  Statement& bind(const std::string& value) { return bind(std::string_view(value)); }
  Statement& bind(const char* value) { return bind(std::string_view(value)); }
  Statement& bind(ByteView value);
  Statement& bindNull();
  template <typename T>
  Statement& bind(const std::optional<T>& value) {
    return value ? bind(*value) : bindNull();
  }

  /// True: a row is available. False: done.
  Result<bool> step();
  /// Steps to the end and drops the rows.
  Status run();

  /// Reads all remaining rows. `make` takes this statement at each row and returns a value or a Result. Stops
  /// at the first error of either.
  template <typename Make>
  auto all(const Make& make) -> Result<std::vector<MadeBy<Make>>> {
    std::vector<MadeBy<Make>> made;
    for (;;) {
      ASSIGN_OR_RETURN(const bool there, step());
      if (!there) return made;
      Result<MadeBy<Make>> one = make(std::as_const(*this));
      if (!one) return one.error();
      made.push_back(std::move(one).value());
    }
  }
  /// Reads only the next row, as all() does; nothing when there is no row.
  template <typename Make>
  auto first(const Make& make) -> Result<std::optional<MadeBy<Make>>> {
    ASSIGN_OR_RETURN(const bool there, step());
    if (!there) return std::optional<MadeBy<Make>>();
    Result<MadeBy<Make>> one = make(std::as_const(*this));
    if (!one) return one.error();
    return std::optional<MadeBy<Make>>(std::move(one).value());
  }

  /// Columns of the current row, from 0. Views are valid until the next step().
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::uint64_t natural(int column) const;  ///< negative reads as 0: the schema forbids it
  [[nodiscard]] std::uint32_t natural32(int column) const {
    return static_cast<std::uint32_t>(natural(column));
  }
  [[nodiscard]] double real(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] ByteView bytes(int column) const;
  [[nodiscard]] bool isNull(int column) const;

 private:
  friend class Connection;
  Statement(Connection* connection, sqlite3_stmt* handle, std::optional<Error> failed);
  void check(int rc);

  Connection* connection_;
  sqlite3_stmt* handle_;  ///< null when preparing failed
  std::optional<Error> failed_;
  int bound_ = 0;
};

/// The first column of a row, for Statement::all and Statement::first.
inline std::string firstText(const Statement& row) {
  return row.text(0);
}

/// A log beside the database above this has long reads given up, because they keep it from being emptied. It
/// is some ten minutes of a thousand stations: smaller, no check of a large database would end; greater, it
/// takes room that others lack.
inline constexpr std::uint64_t kMostLogBytesOfReaders = std::uint64_t{4} << 30;

/// An open database with the settings of db/README.md: WAL, synchronous=FULL, foreign keys on,
/// wal_autocheckpoint=0, no checkpoint on close. Only the writer checkpoints: SQLite before
/// 3.51.3 can destroy the database when one connection checkpoints while another commits. Thread: not
/// thread-safe; one thread at a time (SQLite runs without its own mutex). Must outlive its statements.
class Connection {
 public:
  enum class Mode {
    kWriter,   ///< reads, writes, checkpoints; one per process, and one process per database (lock in
               ///< bootstrap.h)
    kReader,   ///< query_only
    kFrozen,   ///< query_only, of a file that nobody writes to: writes nothing itself, no lock and no
               ///< shared memory beside the file, so that it opens on a full disk; includes the log
    kForeign,  ///< for openForeign() (foreign_database.h): query_only, the file alone, as it is: without what
               ///< a log or a journal beside it says
  };
  struct Options {
    Mode mode = Mode::kReader;
    bool create = false;        ///< writer only: create a missing file
    const char* vfs = nullptr;  ///< a VFS registered by a test; null = the system's
    int busy_timeout_ms = 5000;
    /// Readers only: above this a long read fails with kUnavailable (noteShortRead()).
    std::uint64_t most_log_bytes = kMostLogBytesOfReaders;
    std::filesystem::path copy_of = {};  ///< the file that `path` is a copy of, which messages about its
                                         ///< contents name; empty: none
    /// Foreign files only: reads fail with kUnavailable once `time` is past `until_ns`. `time` may be null:
    /// no bound; it must outlive the connection.
    TimeSource* time = nullptr;
    std::int64_t until_ns = 0;
    /// Foreign files only: as CancelScope, from the opening on. May be null; must outlive the connection.
    const std::atomic<bool>* cancelled = nullptr;
  };

  /// Opens and configures the database. Errors: kNotFound (no file), kInvalidInput (a pipe, device, socket or
  /// folder in its place, or in that of its log or journal), kCorrupt (not a database), kFailed.
  static Result<Connection> open(const std::filesystem::path& path, const Options& options);

  Connection(Connection&& other) noexcept;
  Connection& operator=(Connection&& other) noexcept;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection();

  /// Returns a statement for `sql`, from the cache when possible. `sql` is a single statement.
  Statement prepare(std::string_view sql);
  /// Prepares and binds the values in order.
  template <typename... Values>
  Statement query(std::string_view sql, const Values&... values) {
    Statement statement = prepare(sql);
    (statement.bind(values), ...);
    return statement;
  }
  /// Prepares, binds and runs to the end.
  template <typename... Values>
  Status run(std::string_view sql, const Values&... values) {
    return query(sql, values...).run();
  }
  /// Runs several statements without parameters, e.g. a migration.
  Status script(const std::string& sql);

  [[nodiscard]] std::int64_t lastRowId() const;
  /// Number of rows that the last INSERT, UPDATE or DELETE changed.
  [[nodiscard]] std::int64_t changes() const;
  [[nodiscard]] bool inTransaction() const;

  /// The result of a checkpoint: pages in the log, and how many of them are already in the database. 0 when
  /// the database was busy.
  struct WalProgress {
    std::uint64_t pages = 0, moved = 0;
  };
  /// Moves pages from the WAL into the database, as far as readers allow. Writer only, outside a transaction.
  /// A busy database is not an error.
  Status checkpointPassive(WalProgress* progress = nullptr);

  /// Moves all pages of the WAL into the database and cuts the log's file to 0 bytes, so that nothing that
  /// was overwritten stays in it. Waits up to `patience_ms` for readers; meanwhile nothing is committed.
  /// False: a reader still needs the log. Writer only, outside a transaction.
  Result<bool> emptyLog(int patience_ms);

  /// Size of the write-ahead log's file; 0 when the file does not exist.
  [[nodiscard]] std::uint64_t walBytes();

  /// Begins to count the steps of a read anew: one of up to a million steps of SQLite's virtual machine, some
  /// 0.1 s, is never given up because of the log's size. Each kRead transaction does so, and each borrowing.
  void noteShortRead() { limits_->looks = 0; }

  /// Foreign files only: in the place of Options::until_ns from now on.
  void readUntil(std::int64_t until_ns) { limits_->until_ns = until_ns; }

  /// True after a failure that puts stored data in doubt: disk full, I/O error, corrupt file, a part of a
  /// transaction that could not be undone. Want of memory is none: SQLite
  /// undoes the statement, or the transaction.
  /// Never reset: the writer stops for good.
  [[nodiscard]] bool damaged() const { return damaged_; }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// What messages about the contents name: Options::copy_of, or path(). A disk's fault names path().
  [[nodiscard]] const std::filesystem::path& origin() const { return origin_; }
  [[nodiscard]] sqlite3* handle() { return handle_; }

 private:
  friend class Statement;
  friend class CancelScope;
  friend class Savepoint;
  /// What interrupts statements that run, by SQLite's progress handler.
  struct Limits {
    sqlite3* handle = nullptr;
    const std::atomic<bool>* cancelled = nullptr;  ///< null: nothing cancels
    std::uint64_t most_log_bytes = 0;              ///< 0: any size
    std::uint64_t looks = 0;                       ///< calls of the handler since noteShortRead()
    std::uint64_t log_bytes = 0;                   ///< for which the last interruption was; 0: cancelled
    TimeSource* time = nullptr;                    ///< null: no bound of time
    std::int64_t until_ns = 0;
    bool is_late = false;  ///< the last interruption was because of `until_ns`
  };
  static int goesOn(void* limits);
  Connection(std::filesystem::path path, std::filesystem::path origin, sqlite3* handle);
  void close();
  void giveBack(sqlite3_stmt* statement);
  /// Converts the last call's error; sets `damaged_` for failures that put stored data in doubt.
  Error errorOf(int rc, std::string_view what);

  std::filesystem::path path_, origin_;
  sqlite3* handle_ = nullptr;
  bool damaged_ = false;
  int busy_timeout_ms_ = 0;
  std::unique_ptr<Limits> limits_;  ///< SQLite has its address, which stays when the connection moves
  std::unordered_map<std::string, sqlite3_stmt*> idle_;  ///< prepared statements not in use, by their SQL
};

/// BEGIN … COMMIT. Rolls back on destruction unless commit() returned success.
/// Keep it in a variable for as long as it is needed: ASSIGN_OR_RETURN, never RETURN_IF_ERROR.
/// Thread: as its Connection, which must outlive it.
class Transaction {
 public:
  enum class Kind {
    kRead,   ///< one unchanging view of the database
    kWrite,  ///< takes the write lock at once
  };
  static Result<Transaction> begin(Connection& connection, Kind kind);
  /// Begins a kRead transaction, or returns nothing inside an existing transaction, which already gives a
  /// consistent view. For functions that run both alone and within a caller's transaction.
  static Result<std::optional<Transaction>> view(Connection& connection);
  Transaction(Transaction&& other) noexcept;
  Transaction& operator=(Transaction&&) = delete;
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  ~Transaction();
  /// Returns once the data is on disk (synchronous=FULL).
  Status commit();

 private:
  explicit Transaction(Connection& connection) : connection_(&connection) {}
  Connection* connection_;
};

/// A part of a transaction that can be rolled back alone. Thread: as its Connection, which must outlive it.
class Savepoint {
 public:
  static Result<Savepoint> begin(Connection& connection);
  Savepoint(Savepoint&& other) noexcept;
  Savepoint& operator=(Savepoint&&) = delete;
  Savepoint(const Savepoint&) = delete;
  Savepoint& operator=(const Savepoint&) = delete;
  ~Savepoint();
  Status release();

 private:
  explicit Savepoint(Connection& connection) : connection_(&connection) {}
  Connection* connection_;
};

/// During its lifetime, statements of the connection fail soon after `cancelled` becomes true
/// (SQLITE_INTERRUPT). Null: no effect. Thread: as the connection; any thread may set the flag. Connection
/// and flag must outlive it, and the connection must not be moved.
class CancelScope {
 public:
  CancelScope(Connection& connection, const std::atomic<bool>* cancelled)
      : limits_(*connection.limits_), before_(limits_.cancelled) {
    if (cancelled != nullptr) limits_.cancelled = cancelled;
  }
  ~CancelScope() { limits_.cancelled = before_; }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

 private:
  Connection::Limits& limits_;
  const std::atomic<bool>* before_;
};

/// For a table of AUTOINCREMENT, before a row without a number is added: kFailed when its numbers are used
/// up. Otherwise SQLite would answer SQLITE_FULL, as for a full disk, and undo the whole transaction, with
/// the items of others in it. Thread: as the connection.
Status checkNumbersLeft(Connection& connection, std::string_view table);

}  // namespace needlelab
