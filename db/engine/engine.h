/// The interface that an engine (SQLite, PostgreSQL) implements for Connection and Statement
/// (db/store/connection.h). Only they call it: stores are written once, on Connection.
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

namespace needlelab {

/// What a successful commit survives, and with it every ack. Each level includes the previous ones.
enum class Durability : std::uint8_t {
  kNothing,   ///< the last moments are lost when the database's process ends
  kProcess,   ///< the end of any process, but not a power cut
  kPowerCut,  ///< a power cut
  kDiskLoss,  ///< the loss of a disk: a named standby has the data on its own
};

/// "the loss of a disk".
std::string_view durabilityText(Durability durability);

/// Settings of PostgreSQL, as SHOW prints them.
struct PostgresSettings {
  std::string fsync, full_page_writes, synchronous_commit, synchronous_standby_names;
  /// "fsync = on, …": the settings that decide.
  [[nodiscard]] std::string text() const;
  bool operator==(const PostgresSettings&) const = default;
};

/// Durability of a COMMIT without a warning under these settings, by PostgreSQL's documentation
/// (runtime-config-wal, runtime-config-replication). Standbys count only if all are named (`*` accepts any
/// that connects, even one on the primary's own disk), and only if they have written to disk: remote_write is
/// not enough.
Durability durabilityOf(const PostgresSettings& settings);

/// Key of the lab's id in `meta`, in PostgreSQL databases.
inline constexpr const char* kLabKey = "lab_id";

/// Which lab's database it is, and its schema version.
struct LabIdentity {
  std::string lab;  ///< kLabKey
  std::int64_t schema_version = 0;
};

class SqliteConnection;

/// Results received whole from the engine's server since the connection was made.
struct ResultsSoFar {
  std::uint64_t rows = 0;
  std::uint64_t bytes = 0;    ///< of memory in the driver
  std::uint64_t largest = 0;  ///< bytes of the largest result
};

/// One prepared statement, for one execution at a time. Parameters count from 1, columns from 0. Thread: as
/// its connection, which must outlive it.
class EngineStatement {
 public:
  virtual ~EngineStatement() = default;
  EngineStatement() = default;
  EngineStatement(const EngineStatement&) = delete;
  EngineStatement& operator=(const EngineStatement&) = delete;

  /// The text it was prepared from.
  [[nodiscard]] virtual std::string_view sql() const = 0;
  /// Texts and bytes are copied.
  virtual Status bind(int parameter, std::int64_t value) = 0;
  virtual Status bind(int parameter, double value) = 0;
  virtual Status bind(int parameter, std::string_view value) = 0;
  virtual Status bind(int parameter, ByteView value) = 0;
  virtual Status bindNull(int parameter) = 0;
  /// Binds a list without NULLs as one parameter (an array). kFailed: the engine has no lists (SQLite).
  virtual Status bindList(int parameter, std::span<const std::int64_t> values) {
    return noLists(parameter, values.size());
  }
  virtual Status bindList(int parameter, std::span<const std::string_view> values) {
    return noLists(parameter, values.size());
  }
  virtual Status bindList(int parameter, std::span<const ByteView> values) {
    return noLists(parameter, values.size());
  }
  /// True: there is a row. False: done.
  virtual Result<bool> step() = 0;
  /// Returns to the state before the first step; clears parameters and rows.
  virtual void reset() = 0;

  /// Values of the current row. Views are valid until the next step() or reset().
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
  /// Number of rows that the last INSERT, UPDATE or DELETE changed.
  [[nodiscard]] virtual std::int64_t changes() const = 0;
  [[nodiscard]] virtual bool inTransaction() const = 0;
  /// True after a failure that puts stored data in doubt; never reset.
  [[nodiscard]] virtual bool damaged() const = 0;
  virtual void setDamaged() = 0;
  /// True if the engine's server is gone, and the transaction with it. The transaction must be rolled back;
  /// the next one reconnects.
  [[nodiscard]] virtual bool isLost() const { return false; }

  enum class Begin {
    kView,   ///< one unchanging view of the database
    kWrite,  ///< excludes other writers until it ends
    /// Like kWrite, but an engine whose statements cost round trips begins together with the first statement
    /// (or commit()), in one round trip. That statement reports begin()'s errors, as does everything after it
    /// until rollback(); durability() keeps its old value until then.
    kWriteSoon,
    /// Others continue writing. For tables that stores do not use, whose rows or locks decide who is first.
    /// On SQLite same as kWrite.
    kSide,
  };
  virtual Status begin(Begin kind) = 0;
  /// Returns once the data is as safe as the engine makes it.
  virtual Status commit() = 0;
  virtual void rollback() = 0;
  /// Only one at a time.
  virtual Status savepoint() = 0;
  virtual Status releaseSavepoint() = 0;
  /// Undoes what came since savepoint(), and releases it.
  virtual Status undoSavepoint() = 0;

  /// What a successful commit() survives, as far as is known. It may change at run time and is re-read at the
  /// start of each write transaction.
  [[nodiscard]] virtual Durability durability() const = 0;
  /// The settings that determine durability().
  [[nodiscard]] virtual std::string durabilityReason() const = 0;
  /// How often it has connected to the engine's server; each time a different server may answer.
  [[nodiscard]] virtual std::uint64_t timesConnected() const { return 1; }
  /// From now on reconnects only to this lab's database. If another lab's, or one with another schema,
  /// answers at its address, the connection is refused with kUnavailable.
  virtual void stayWith(LabIdentity /*lab*/) {}
  /// Whether no one else works on the database, for a connection that excludes others. For SQLite the
  /// folder's lock ensures this.
  [[nodiscard]] virtual bool isAlone() const { return true; }
  /// Ends isAlone() if others may work beside it (PostgresOptions::Others::kShared).
  virtual Status admitOthers() { return {}; }
  /// Data that the engine's server lost although commit() on this connection returned success, as found on
  /// reconnecting; human-readable. Empty: nothing. Stays until more is found.
  [[nodiscard]] virtual std::string lack() const { return {}; }
  /// The last "no space" error of the engine's server since the previous call; empty: none.
  virtual std::string takeFull() { return {}; }

  /// Statements end with kUnavailable soon after `cancelled` (may be null) becomes true. Returns the previous
  /// one.
  virtual const std::atomic<bool>* setCancelled(const std::atomic<bool>* cancelled) = 0;

  /// Work to do on this thread while it waits for the engine's server, in pieces of some µs. A piece returns
  /// false if there is nothing (more) to do in this wait. It must not use the connection or throw. Engines
  /// without a server never call it. Empty: nothing.
  virtual void setWhileWaiting(std::function<bool()> /*piece*/) {}

  /// Until the next reconnection, waitForNotices() receives commits with a NOTIFY on `channel`. kFailed: the
  /// engine has no notifications.
  virtual Status listen(const std::string& channel) {
    return Error{ErrorCode::kFailed, channel + ": this engine does not notify of changes"};
  }
  /// Waits at most `patience` for notices and returns their payloads; none if nothing arrived. kUnavailable:
  /// the connection is lost; this does not reconnect.
  virtual Result<std::vector<std::string>> waitForNotices(std::chrono::milliseconds /*patience*/) {
    return Error{ErrorCode::kFailed, "this engine does not notify of changes"};
  }

  /// Number of waits for the engine's server.
  [[nodiscard]] virtual std::uint64_t roundTrips() const { return 0; }
  /// Results read from the engine's server; empty for SQLite, which returns row by row.
  [[nodiscard]] virtual ResultsSoFar results() const { return {}; }
  /// False: a pool must not keep the connection, because closing it may free resources (memory) that the
  /// server lacks, or because it is no longer in its initial state.
  [[nodiscard]] virtual bool isReusable() const { return !damaged(); }

  /// Access to SQLite-only features; null for other engines.
  [[nodiscard]] virtual SqliteConnection* sqlite() { return nullptr; }
};

}  // namespace needlelab
