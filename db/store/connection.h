/// The engine-independent base of the stores: Statement, Connection, transactions and savepoints that roll
/// back unless committed, and CancelScope, which interrupts long reads. Errors are values.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "db/engine/engine.h"
#include "db/engine/sqlite.h"

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
  /// A list as one parameter, like EngineStatement::bindList(): PostgreSQL only. Copies texts and bytes.
  Statement& bindList(std::span<const std::int64_t> values);
  Statement& bindList(std::span<const std::string_view> values);
  Statement& bindList(std::span<const ByteView> values);
  template <typename T>
  Statement& bind(const std::optional<T>& value) {
    return value ? bind(*value) : bindNull();
  }

  /// True: a row is available. False: done.
  Result<bool> step();
  /// Steps to the end and drops the rows.
  Status run();
  /// For an INSERT of one row that ends with RETURNING and an integer: runs it to the end and returns the
  /// integer.
  Result<std::int64_t> runReturning();

  /// Reads all remaining rows. `make` receives this statement at each row and returns a value or a Result.
  /// Stops at the first error of either.
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
  /// Reads only the next row, like all(); nothing at the end.
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
  Statement(Connection* connection, std::unique_ptr<EngineStatement> statement);
  Statement(Connection* connection, Error failed);
  template <typename Value>
  Statement& bindNext(Value value);
  template <typename Value>
  Statement& bindNextList(std::span<const Value> values);

  Connection* connection_;
  std::unique_ptr<EngineStatement> statement_;  ///< null if preparing failed
  std::optional<Error> failed_;
  int bound_ = 0;
};

/// The first column of a row, for Statement::all and Statement::first.
inline std::string firstText(const Statement& row) {
  return row.text(0);
}

/// An open database. Thread: not thread-safe; one thread at a time. Must outlive its statements.
class Connection {
 public:
  using Mode = SqliteConnection::Mode;
  using Options = SqliteConnection::Options;
  using WalProgress = SqliteConnection::WalProgress;

  /// Opens an SQLite database; see SqliteConnection::open().
  static Result<Connection> open(const std::filesystem::path& path, const Options& options);
  /// Takes a connection of any engine. `folder_file`: what path() returns.
  Connection(std::unique_ptr<EngineConnection> engine, std::filesystem::path folder_file);

  Connection(Connection&& other) noexcept;
  Connection& operator=(Connection&& other) noexcept;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection();

  /// Returns a statement for `sql`, from the cache if possible. `sql` must be a single statement.
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
  /// Same, with Statement::runReturning().
  template <typename... Values>
  Result<std::int64_t> insert(std::string_view sql, const Values&... values) {
    return query(sql, values...).runReturning();
  }
  /// Runs several statements without parameters, e.g. a migration.
  Status script(const std::string& sql);

  /// Number of rows that the last INSERT, UPDATE or DELETE changed.
  [[nodiscard]] std::int64_t changes() const;
  [[nodiscard]] bool inTransaction() const;

  // For SQLite's log; no effect on other engines.

  /// Moves pages from the WAL into the database, as far as readers allow. Writer only, outside a transaction.
  /// A busy database is not an error.
  Status checkpointPassive(WalProgress* progress = nullptr);

  /// Moves all pages of the WAL into the database and truncates the log file, so that overwritten data does
  /// not remain in it. Waits up to `patience_ms` for readers, blocking commits meanwhile. False: a reader
  /// still needs the log. Writer only, outside a transaction.
  Result<bool> emptyLog(int patience_ms);

  /// Size of the write-ahead log file; 0 if it does not exist.
  [[nodiscard]] std::uint64_t walBytes();

  /// Restarts the step count of a read: one of up to a million steps of SQLite's virtual machine (about 0.1
  /// s) is never aborted because of the log's size. Called by each kRead transaction and each borrowing from
  /// a pool.
  void noteShortRead();

  /// Foreign files only: replaces Options::until_ns from now on.
  void readUntil(std::int64_t until_ns);

  /// True after a failure that puts stored data in doubt: disk full, I/O error, corrupt file, part of a
  /// transaction that could not be undone. Running out of memory is not such a failure: SQLite undoes the
  /// statement or transaction. Never reset: the writer stops permanently.
  [[nodiscard]] bool damaged() const { return engine_->damaged(); }

  /// True if the engine's server is gone, and the transaction with it. The transaction must be rolled back;
  /// the next one reconnects. Never with SQLite.
  [[nodiscard]] bool isLost() const { return engine_->isLost(); }

  /// What an ack survives, as far as is known (engine.h), and the settings that determine it.
  [[nodiscard]] Durability durability() const { return engine_->durability(); }
  [[nodiscard]] std::string durabilityReason() const { return engine_->durabilityReason(); }
  /// How often it has connected (EngineConnection::timesConnected); 1 with SQLite.
  [[nodiscard]] std::uint64_t timesConnected() const { return engine_->timesConnected(); }
  /// Reconnects only to this lab's database (EngineConnection::stayWith).
  void stayWith(LabIdentity lab) { engine_->stayWith(std::move(lab)); }
  /// Whether no one else works on the database (EngineConnection::isAlone, admitOthers).
  [[nodiscard]] bool isAlone() const { return engine_->isAlone(); }
  Status admitOthers() { return engine_->admitOthers(); }
  /// Data committed here that the engine's server no longer has (EngineConnection::lack).
  [[nodiscard]] std::string lack() const { return engine_->lack(); }
  /// The engine's server's last "no space" error (EngineConnection::takeFull).
  std::string takeFull() { return engine_->takeFull(); }

  /// Work for this thread while it waits for the engine's server (EngineConnection::setWhileWaiting).
  void setWhileWaiting(std::function<bool()> piece) { engine_->setWhileWaiting(std::move(piece)); }

  /// Notifications from other connections (EngineConnection::listen, waitForNotices); PostgreSQL only.
  Status listen(const std::string& channel) { return engine_->listen(channel); }
  Result<std::vector<std::string>> waitForNotices(std::chrono::milliseconds patience) {
    return engine_->waitForNotices(patience);
  }

  /// Number of waits for the engine's server; 0 with SQLite.
  [[nodiscard]] std::uint64_t roundTrips() const { return engine_->roundTrips(); }
  /// Results received from the engine's server (EngineConnection::results).
  [[nodiscard]] ResultsSoFar results() const { return engine_->results(); }
  /// Whether a pool may keep it (EngineConnection::isReusable).
  [[nodiscard]] bool isReusable() const { return engine_->isReusable(); }

  /// The database's file. For other engines: a file of that name in the lab's folder, where its keys are.
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// The file named in messages about the contents: Options::copy_of, or path(). Disk errors name path().
  [[nodiscard]] const std::filesystem::path& origin() const;
  /// Access to SQLite-only features; null for other engines.
  [[nodiscard]] SqliteConnection* sqlite() { return engine_->sqlite(); }
  /// SQLite's handle; null for other engines.
  [[nodiscard]] sqlite3* handle() { return sqlite() != nullptr ? sqlite()->handle() : nullptr; }

 private:
  friend class Statement;
  friend class CancelScope;
  friend class Savepoint;
  friend class Transaction;
  void close();
  void giveBack(std::unique_ptr<EngineStatement> statement);

  std::filesystem::path path_;
  std::unique_ptr<EngineConnection> engine_;  ///< null after a move
  struct Kept {
    std::unique_ptr<EngineStatement> statement;  ///< null: in use
    std::uint64_t used = 0;                      ///< value of uses_ when it was returned
  };
  /// Makes room for one more by dropping the least recently used one.
  void forgetOldest();
  /// Prepared statements by SQL text.
  std::unordered_map<std::string, Kept> idle_;
  std::uint64_t uses_ = 0;
};

/// BEGIN … COMMIT. Rolls back on destruction unless commit() returned success. Keep it in a variable as long
/// as it is needed: ASSIGN_OR_RETURN, never RETURN_IF_ERROR. Thread: as its Connection, which must outlive
/// it.
class Transaction {
 public:
  enum class Kind {
    kRead,   ///< one unchanging view of the database
    kWrite,  ///< takes the write lock immediately
    /// Like kWrite, but on PostgreSQL sent with the first statement (EngineConnection::Begin::kWriteSoon),
    /// which then reports begin()'s errors.
    kWriteSoon,
    /// Neither waits for writers nor makes them wait (EngineConnection::Begin::kSide); on its own
    /// connection.
    kSide,
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
      : engine_(cancelled != nullptr ? connection.engine_.get() : nullptr) {
    if (engine_ != nullptr) before_ = engine_->setCancelled(cancelled);
  }
  ~CancelScope() {
    if (engine_ != nullptr) engine_->setCancelled(before_);
  }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

 private:
  EngineConnection* engine_;  ///< null: no effect
  const std::atomic<bool>* before_ = nullptr;
};

}  // namespace needlelab
