/// The engine PostgreSQL (15 or later), through libpq: prepared statements, binary values.
#pragma once

#include <libpq-fe.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/engine/engine.h"
#include "db/engine/open_postgres.h"

namespace needlelab {

/// The schema of all needlelab tables.
inline constexpr const char* kPostgresSchema = "needlelab";

/// The fields of PostgresSettings, in order.
inline constexpr const char* kSettingsQuery =
    "current_setting('fsync'), current_setting('full_page_writes'), current_setting('synchronous_commit'),"
    " current_setting('synchronous_standby_names')";

/// The table that each write transaction locks until it ends, so that what it has read stays unchanged even
/// with several servers, as with SQLite's single writer. Locking it needs rights that needlelab grants to no
/// other role.
inline constexpr const char* kWriterTable = "needlelab.schema_version";
/// The lock used until that table exists (pg_advisory_xact_lock).
inline constexpr std::int64_t kWriterLock = 0x6e6c6162;
/// The lock of PostgresOptions::others: exclusive for kNone, shared for kShared (pg_try_advisory_lock,
/// pg_try_advisory_lock_shared). Any role that may connect to the database can take it and so keep a server
/// from starting.
inline constexpr std::int64_t kAloneLock = 0x6e6c6163;
/// Together with the hash of a name, the lock of PostgresOptions::only_one_named.
inline constexpr std::int32_t kNamedLock = 0x6e6c6164;

/// One connection. A result is read whole before its first row is returned, so several statements may be in
/// progress at a time. A lost connection is restored at the next begin of a transaction, or statement outside
/// one; until then every call fails with kUnavailable. Thread: not thread-safe; one thread at a time.
class PostgresConnection final : public EngineConnection {
 public:
  /// As openPostgres().
  static Result<std::unique_ptr<PostgresConnection>> open(const PostgresOptions& options);
  ~PostgresConnection() override;

  Result<std::unique_ptr<EngineStatement>> prepare(const std::string& sql) override;
  Status script(const std::string& sql) override;
  [[nodiscard]] std::int64_t changes() const override { return changes_; }
  [[nodiscard]] bool inTransaction() const override;
  [[nodiscard]] bool damaged() const override { return damaged_; }
  void setDamaged() override { damaged_ = true; }
  [[nodiscard]] bool isLost() const override { return in_lost_transaction_; }
  /// A write transaction begins with one round trip, kWriteSoon with none of its own
  /// (postgres_transactions.cpp).
  Status begin(Begin kind) override;
  /// kUnavailable if PostgreSQL reports success with a warning: a wait for the standby was cancelled, and
  /// only the primary has the data. The same if synchronous_standby_names was emptied meanwhile, which ends
  /// the wait without a warning: under PostgresOptions::least = kDiskLoss the settings are re-read in the
  /// same round trip. If the connection is lost, the outcome is queried (pg_xact_status) on reconnecting,
  /// within answer_timeout; if that fails, the message says that the outcome is unknown.
  Status commit() override;
  void rollback() override;
  // Savepoints are made and released together with the next statement, in one round trip
  // (postgres_savepoints.cpp); one without a statement costs nothing. A savepoint at the very beginning of a
  // kWriteSoon is the transaction itself: undoing it rolls back and begins again.
  Status savepoint() override;
  Status releaseSavepoint() override;
  Status undoSavepoint() override;
  [[nodiscard]] Durability durability() const override { return durabilityOf(settings_); }
  [[nodiscard]] std::string durabilityReason() const override { return settings_.text(); }
  [[nodiscard]] std::uint64_t timesConnected() const override { return times_connected_; }
  void stayWith(LabIdentity lab) override { lab_ = std::move(lab); }
  /// After each reconnection, looks up the last transaction that commit() reported as successful
  /// (pg_xact_status): a lagging standby that was promoted, or an older backup, lacks it. Not detected if
  /// another transaction has taken its number meanwhile.
  [[nodiscard]] std::string lack() const override { return lack_; }
  [[nodiscard]] bool isAlone() const override { return is_alone_; }
  Status admitOthers() override;
  std::string takeFull() override { return std::exchange(full_, {}); }
  const std::atomic<bool>* setCancelled(const std::atomic<bool>* cancelled) override;
  void setWhileWaiting(std::function<bool()> piece) override;
  Status listen(const std::string& channel) override;
  Result<std::vector<std::string>> waitForNotices(std::chrono::milliseconds patience) override;
  [[nodiscard]] std::uint64_t roundTrips() const override { return round_trips_; }
  [[nodiscard]] ResultsSoFar results() const override { return results_; }
  [[nodiscard]] bool isReusable() const override;

  /// The URL without a password, for messages.
  [[nodiscard]] const std::string& shownUrl() const { return shown_url_; }
  [[nodiscard]] bool isConnected() const;

  /// A statement's value as sent.
  struct Value {
    std::uint32_t type = 0;  ///< PostgresType
    bool is_null = true;
    std::string bytes;
  };
  struct ResultCloser {
    void operator()(PGresult* result) const { PQclear(result); }
  };
  using ResultPtr = std::unique_ptr<PGresult, ResultCloser>;

  // for its statements
  /// Counts connections; statements prepared on an earlier one are gone.
  [[nodiscard]] std::uint64_t epoch() const { return epoch_; }
  /// Prepares `sql` (in PostgreSQL's form) and returns the name. If not `kept`, it is valid only until the
  /// next one that is not kept.
  Result<std::string> prepareNow(const std::string& sql, const std::vector<Value>& values, bool kept);
  /// Whether PostgreSQL, which keeps each name's plan in the connection's process, may get another one: at
  /// most kMaxNamed in total, but at least one per statement.
  [[nodiscard]] bool mayNameMore() const { return named_ < kMaxNamed; }
  /// Releases names that prepareNow() made at this `epoch`: they are deallocated together with the next
  /// statement that is prepared.
  void releaseStatements(std::vector<std::string> names, std::uint64_t epoch);
  Result<ResultPtr> execute(const std::string& prepared, const std::vector<Value>& values,
                            std::string_view what);
  /// Reconnects if the connection is lost, unless a transaction was lost with it.
  Status requireConnected();
  /// Whether PostgreSQL has closed the connection since its last statement, so that a pooled connection whose
  /// server was replaced causes no error. Call outside a transaction.
  bool endedWhileIdle();

 private:
  struct ConnectionCloser {
    void operator()(PGconn* connection) const { PQfinish(connection); }
  };
  explicit PostgresConnection(PostgresOptions options) : options_(std::move(options)), lab_(options_.lab) {}
  /// `takes_locks`: those of `others` and `only_one_named`, if set.
  Status connect(bool takes_locks = true);
  [[nodiscard]] bool hasLocks() const { return options_.others != PostgresOptions::Others::kAll; }
  void notifyBeforeStatement(std::string_view sql) const {
    if (options_.before_statement) options_.before_statement(sql);
  }
  /// Takes kAloneLock and the named lock; waits at most 2 s for them.
  Status takeLocks();
  Result<bool> tryLock(const std::string& sql);
  /// In one round trip: makes the connection read-only if the options say so, and reads the settings and, if
  /// lab_ is set, the database's identity.
  Status settle();
  /// kUnavailable unless a row's columns from `column` on identify lab_'s database.
  Status requireLab(const PGresult* row, int column) const;
  /// Notes the settings in a row's columns from `column` on (kSettingsQuery).
  void noteSettings(const PGresult* row, int column);
  /// kUnavailable if an ack would survive less than required.
  Status requireDurable() const;
  struct Waiting {
    std::chrono::steady_clock::time_point until;
    bool asked_to_end = false;
  };
  /// Waits for the next result of what was sent; null: no more. Ends early with kUnavailable if cancelled or
  /// if no answer comes.
  Result<ResultPtr> nextResult(Waiting& waiting, std::string_view what);
  /// Waits for all results of what was sent; returns the last.
  Result<ResultPtr> wait(std::string_view what);
  /// Returns the result unless it is an error; notes changes().
  Result<ResultPtr> checked(ResultPtr last, std::string_view what);
  /// Sends the due statements and then what `send` sends (a libpq call that returns 0 on failure); returns
  /// the latter's result.
  Result<ResultPtr> behindDue(const std::function<int()>& send, std::string_view what);
  /// Ends the batch sent in pipeline mode, waits for its results and leaves that mode. `take` gets the result
  /// of each statement that ran, but none for those skipped after a failure.
  Status endPipeline(std::string_view what, const std::function<void(ResultPtr)>& take);
  Status sendDue();
  void dropDue();
  Status requireSound(const char* what);
  /// Sends BEGIN, the locking statement and the settings query in pipeline mode. Returns the number of their
  /// results; 0 on failure.
  int sendBegin();
  /// Takes one of these results, which succeeded.
  void noteBegin(std::size_t step, std::size_t steps, const PGresult* result);
  /// Rolls back; every call until the caller's own rollback() returns this error.
  Error notBegun(Error why);
  Status runText(const char* sql);
  Error errorOf(const PGresult* result, std::string_view what);
  Error lost(std::string_view what);
  static void noteNotice(void* self, const PGresult* notice);
  /// COMMIT's result.
  Result<ResultPtr> runCommit();
  /// Like runCommit(), and reads the settings after it, in the same round trip.
  Result<ResultPtr> commitAndReadSettings();
  /// "committed", "aborted", "in progress", "" (too long ago), or "unknown": this server never had it.
  Result<std::string> statusOf(const std::string& xid);
  /// Notes in lack_ if this server lacks the last acknowledged transaction.
  Status checkLastAcknowledged();
  /// Finds out what became of transaction `xid`, whose COMMIT got no answer.
  Status queryOutcome(const std::string& xid);

  const PostgresOptions options_;
  std::string shown_url_;
  std::optional<LabIdentity> lab_;  ///< required of each connection from now on
  PostgresSettings settings_;       ///< as of the last write transaction or connection
  std::unique_ptr<PGconn, ConnectionCloser> connection_;
  const std::atomic<bool>* cancelled_ = nullptr;
  std::int64_t changes_ = 0;
  std::function<bool()> while_waiting_;
  std::uint64_t epoch_ = 0, prepared_ = 0;
  std::uint64_t times_connected_ = 0;  ///< successful ones, without those only to query an outcome
  std::uint64_t round_trips_ = 0;      ///< without those for connecting
  std::uint64_t settings_epoch_ = 0;   ///< the epoch in which the settings statement was prepared
  bool damaged_ = false;
  bool in_lost_transaction_ = false;  ///< the connection was lost within a transaction not rolled back yet
  bool in_transaction_ = false;  ///< begin() succeeded, and neither commit() nor rollback() was called since
  bool is_side_ = false;         ///< a kSide transaction: may have written although write_xid_ is empty
  bool begin_due_ = false;       ///< BEGIN is sent with the next statement
  std::optional<Error> not_begun_;  ///< why BEGIN failed, until rollback()
  bool saw_writer_table_ = false;   ///< whether kWriterTable existed in the last write transaction
  bool is_alone_ = false;           ///< holds kAloneLock exclusively, and takes it again after a reconnection
  std::string write_xid_;           ///< of the current write transaction
  std::string acknowledged_xid_;    ///< the last one that commit() reported as successful
  std::string lack_, full_;
  std::optional<std::string> warning_;  ///< since the last commit began
  enum class AtSavepoint { kNone, kDue, kMade, kBegin };
  AtSavepoint savepoint_ = AtSavepoint::kNone;
  std::vector<const char*> due_;  ///< statements without results, to be sent with the next one
  static constexpr std::size_t kMaxNamed = 512;
  std::size_t named_ = 0;  ///< names that PostgreSQL knows, including given_up_
  std::vector<std::string> given_up_;
  std::size_t due_done_ = 0;  ///< how many of due_ behindDue() has executed
  ResultsSoFar results_;
  bool lacks_resources_ = false;  ///< an error of class 53 occurred: memory, disk space, connections
};

// --- what is wrong with an address, before connecting and after a failure to connect

/// host, port, database and user of a URL, for messages. kInvalidInput also if it contains a password.
Result<std::string> withoutPassword(const std::string& url);

/// `said`: libpq's message about a failed connection, with lines for each host it tried. kDenied: user,
/// password or pg_hba.conf. kInvalidInput: something does not exist (database, user, host name, file), or a
/// bad parameter value. kUnavailable: one of the hosts may answer later, or the server's messages are not
/// English (libpq gives no SQLSTATE for a failed connection).
Error cannotConnect(const std::string& shown_url, const char* said);

}  // namespace needlelab
