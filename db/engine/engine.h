/// What an engine (SQLite, PostgreSQL) does for Connection and Statement (db/connection.h). Nobody else calls
/// it: stores are written once, on Connection.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "db/engine/durability.h"
#include "db/engine/lab_identity.h"

namespace needlelab {

class SqliteConnection;

/// Results that came whole from the engine's server, since the connection was made.
struct ResultsSoFar {
  std::uint64_t rows = 0;
  std::uint64_t bytes = 0;    ///< of memory, as the driver holds them
  std::uint64_t largest = 0;  ///< the bytes of the largest one
};

/// One prepared statement, for one execution at a time. Parameters count from 1, columns from 0. Thread: as
/// its connection, which must outlive it.
class EngineStatement {
 public:
  virtual ~EngineStatement() = default;
  EngineStatement() = default;
  EngineStatement(const EngineStatement&) = delete;
  EngineStatement& operator=(const EngineStatement&) = delete;

  /// The text that it was prepared from.
  [[nodiscard]] virtual std::string_view sql() const = 0;
  /// Texts and bytes are copied.
  virtual Status bind(int parameter, std::int64_t value) = 0;
  virtual Status bind(int parameter, double value) = 0;
  virtual Status bind(int parameter, std::string_view value) = 0;
  virtual Status bind(int parameter, ByteView value) = 0;
  virtual Status bindNull(int parameter) = 0;
  /// A list, without NULLs, as one parameter (an array). kFailed: the engine has none (SQLite).
  virtual Status bindList(int parameter, std::span<const std::int64_t> values) {
    return noLists(parameter, values.size());
  }
  virtual Status bindList(int parameter, std::span<const std::string_view> values) {
    return noLists(parameter, values.size());
  }
  virtual Status bindList(int parameter, std::span<const ByteView> values) {
    return noLists(parameter, values.size());
  }
  /// True: a row is there. False: done.
  virtual Result<bool> step() = 0;
  /// Back to before the first step, without parameters and rows.
  virtual void reset() = 0;

  /// Of the current row. Views are valid until the next step() or reset().
  [[nodiscard]] virtual std::int64_t integer(int column) const = 0;
  [[nodiscard]] virtual double real(int column) const = 0;
  [[nodiscard]] virtual ByteView bytes(int column) const = 0;
  [[nodiscard]] virtual bool isNull(int column) const = 0;

 private:
  static Status noLists(int parameter, std::size_t count) {
    return Error{ErrorCode::kFailed, "parameter " + std::to_string(parameter) + " is a list of " +
                                         std::to_string(count) + " values, and the engine takes none"};
  }
};

/// A connection to a database. Thread: not thread-safe; one thread at a time.
class EngineConnection {
 public:
  virtual ~EngineConnection() = default;
  EngineConnection() = default;
  EngineConnection(const EngineConnection&) = delete;
  EngineConnection& operator=(const EngineConnection&) = delete;

  virtual Result<std::unique_ptr<EngineStatement>> prepare(const std::string& sql) = 0;
  /// Runs several statements without parameters.
  virtual Status script(const std::string& sql) = 0;
  /// Rows that the last INSERT, UPDATE or DELETE changed.
  [[nodiscard]] virtual std::int64_t changes() const = 0;
  [[nodiscard]] virtual bool inTransaction() const = 0;
  /// True after a failure that puts stored data in doubt; never reset.
  [[nodiscard]] virtual bool damaged() const = 0;
  virtual void setDamaged() = 0;
  /// True when the engine's server is gone, and with it the transaction: it must be rolled back, and the next
  /// one connects again.
  [[nodiscard]] virtual bool isLost() const { return false; }

  enum class Begin {
    kView,   ///< one unchanging view of the database
    kWrite,  ///< nobody else writes until its end
    /// The same, but an engine whose statements cost round trips begins with the first statement (or
    /// commit()), and in one round trip with it: that one has begin()'s errors, and so has all that comes
    /// behind it until rollback(); durability() is as before until then.
    kWriteSoon,
    /// Others go on writing: for tables that stores leave alone, whose rows or locks say who is first. On
    /// SQLite as kWrite.
    kBeside,
  };
  virtual Status begin(Begin kind) = 0;
  /// Returns once what was written is as safe as the engine makes it.
  virtual Status commit() = 0;
  virtual void rollback() = 0;
  /// Only one at a time.
  virtual Status savepoint() = 0;
  virtual Status releaseSavepoint() = 0;
  /// Undoes what came since savepoint(), and releases it.
  virtual Status undoSavepoint() = 0;

  /// What a commit() that returns success survives, as far as is known: it may change while this runs, and is
  /// looked at again at each begin of a write transaction.
  [[nodiscard]] virtual Durability durability() const = 0;
  /// The settings that it follows from.
  [[nodiscard]] virtual std::string durabilityReason() const = 0;
  /// How often it has connected to the engine's server: another one may answer each time.
  [[nodiscard]] virtual std::uint64_t timesConnected() const { return 1; }
  /// From now on it connects again to this lab's database only: another one, or one of another schema, may
  /// answer at its address then, and is refused with kUnavailable.
  virtual void stayWith(LabIdentity /*lab*/) {}
  /// Nobody else works on the database: of a connection that keeps others out. SQLite's folder has a lock.
  [[nodiscard]] virtual bool isAlone() const { return true; }
  /// Ends isAlone(), where others may work beside it (PostgresOptions::Others::kTogether).
  virtual Status letOthersIn() { return {}; }
  /// What the engine's server no longer has although a commit() of this connection returned success, as found
  /// when it connected again, for a person; empty: nothing. It stays until more is found.
  [[nodiscard]] virtual std::string lack() const { return {}; }
  /// The last error since the last call that says that the engine's server has no room; empty: none.
  virtual std::string takeFull() { return {}; }

  /// Statements end with kUnavailable soon after `cancelled`, which may be null, became true. Returns the one
  /// of before.
  virtual const std::atomic<bool>* setCancelled(const std::atomic<bool>* cancelled) = 0;

  /// What the thread does while it waits for the engine's server, in pieces of some µs; a piece returns false
  /// when there is nothing (more) to do in this wait. It may not use the connection, nor throw. Never called
  /// by an engine without a server. Empty: nothing.
  virtual void setWhileWaiting(std::function<bool()> /*piece*/) {}

  /// From now on, until it is connected again, waitForNotices() hears what is committed with a NOTIFY of
  /// `channel`. kFailed: the engine has no server that tells.
  virtual Status listen(const std::string& channel) {
    return Error{ErrorCode::kFailed, channel + ": this engine tells nobody of changes"};
  }
  /// Waits until something is heard, at most for `patience`; returns the payloads, which are none when
  /// nothing was. kUnavailable: the connection is lost; this does not connect again.
  virtual Result<std::vector<std::string>> waitForNotices(std::chrono::milliseconds /*patience*/) {
    return Error{ErrorCode::kFailed, "this engine tells nobody of changes"};
  }

  /// How often it has waited for the engine's server.
  [[nodiscard]] virtual std::uint64_t roundTrips() const { return 0; }
  /// What it has read from the engine's server; nothing with SQLite, which gives row by row.
  [[nodiscard]] virtual ResultsSoFar results() const { return {}; }
  /// False: its end may free what the engine's server lacks (memory), or it is not as a new one is; a pool
  /// must not keep it.
  [[nodiscard]] virtual bool mayBeKept() const { return !damaged(); }

  /// What only SQLite has; null: this is another engine.
  [[nodiscard]] virtual SqliteConnection* sqlite() { return nullptr; }
};

}  // namespace needlelab
