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

/// The schema that all of needlelab's tables are in.
inline constexpr const char* kPostgresSchema = "needlelab";

/// What PostgresSettings has, in its order.
inline constexpr const char* kSettingsQuery =
    "current_setting('fsync'), current_setting('full_page_writes'), current_setting('synchronous_commit'),"
    " current_setting('synchronous_standby_names')";

/// The table that each write transaction locks to its end, so that whatever it looks at before it writes
/// stays so, whichever server writes: as with SQLite's single writer. To lock it, a role needs rights that
/// needlelab gives to nobody else.
inline constexpr const char* kWriterTable = "needlelab.schema_version";
/// The lock in its place while that table is not there (pg_advisory_xact_lock).
inline constexpr std::int64_t kWriterLock = 0x6e6c6162;
/// The lock of PostgresOptions::others: exclusive for kNone, shared for kTogether (pg_try_advisory_lock,
/// pg_try_advisory_lock_shared). Every role that may connect to the database can take it, and keep a server
/// from starting.
inline constexpr std::int64_t kAloneLock = 0x6e6c6163;
/// With the hash of a name behind it, the lock of PostgresOptions::only_one_named.
inline constexpr std::int32_t kNamedLock = 0x6e6c6164;

/// One connection. A result is read whole before the first row is given, so several statements may be under
/// way at a time. What is lost with its server is connected again at the next begin of a transaction, or
/// statement outside one; until then every call fails with kUnavailable. Thread: not thread-safe; one thread
/// at a time.
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
  /// kUnavailable when PostgreSQL reports success with a warning: a wait for the standby was cancelled, and
  /// the data is at the primary only. So it is when synchronous_standby_names was emptied meanwhile, which
  /// ends the wait without a warning: under PostgresOptions::least = kDiskLoss the settings are read
  /// again, in the same round trip.
  /// When the connection is lost meanwhile, the outcome is asked for (pg_xact_status) at the next connection,
  /// within answer_timeout; if that cannot be had, the message says that it is unknown.
  Status commit() override;
  void rollback() override;
  // Savepoints are made and released together with the next statement, in one round trip
  // (postgres_savepoints.cpp); one without a statement costs none. The one at the very beginning of a
  // kWriteSoon is the transaction itself: to undo it, that is rolled back and begun once more.
  Status savepoint() override;
  Status releaseSavepoint() override;
  Status undoSavepoint() override;
  [[nodiscard]] Durability durability() const override { return durabilityOf(settings_); }
  [[nodiscard]] std::string durabilityReason() const override { return settings_.text(); }
  [[nodiscard]] std::uint64_t timesConnected() const override { return times_connected_; }
  void stayWith(LabIdentity lab) override { lab_ = std::move(lab); }
  /// After each reconnection the last transaction that commit() returned success for is looked up
  /// (pg_xact_status): a standby that lagged and was promoted, or an older backup, does not have it. Not
  /// found where somebody else's transactions have taken its number meanwhile.
  [[nodiscard]] std::string lack() const override { return lack_; }
  [[nodiscard]] bool isAlone() const override { return is_alone_; }
  Status letOthersIn() override;
  std::string takeFull() override { return std::exchange(full_, {}); }
  const std::atomic<bool>* setCancelled(const std::atomic<bool>* cancelled) override;
  void setWhileWaiting(std::function<bool()> piece) override;
  Status listen(const std::string& channel) override;
  Result<std::vector<std::string>> waitForNotices(std::chrono::milliseconds patience) override;
  [[nodiscard]] std::uint64_t roundTrips() const override { return round_trips_; }
  [[nodiscard]] ResultsSoFar results() const override { return results_; }
  [[nodiscard]] bool mayBeKept() const override;

  /// The URL without a password, for messages.
  [[nodiscard]] const std::string& shownUrl() const { return shown_url_; }
  [[nodiscard]] bool isConnected() const;

  /// A value of a statement, as it is sent.
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
  /// Counts the connections that were made: what was prepared on another one is gone.
  [[nodiscard]] std::uint64_t epoch() const { return epoch_; }
  /// Prepares `sql`, in PostgreSQL's form; returns the name. Not `kept`: until the next one that is not.
  Result<std::string> prepareNow(const std::string& sql, const std::vector<Value>& values, bool kept);
  /// Whether PostgreSQL, which keeps each name's plan in the memory of the connection's process, gets one
  /// more: not beyond kMostNamed, but each statement may have one.
  [[nodiscard]] bool mayNameMore() const { return named_ < kMostNamed; }
  /// Names that prepareNow() made at this `epoch` are used no more: PostgreSQL forgets them together with the
  /// next statement that is prepared.
  void giveUp(std::vector<std::string> names, std::uint64_t epoch);
  Result<ResultPtr> execute(const std::string& prepared, const std::vector<Value>& values,
                            std::string_view what);
  /// Connects again where the connection is lost, and there is no transaction that went with it.
  Status requireConnected();
  /// Whether PostgreSQL has closed the connection since its last statement: so one of a pool whose server was
  /// replaced costs nobody an error. Outside of a transaction.
  bool endedWhileIdle();

 private:
  struct ConnectionCloser {
    void operator()(PGconn* connection) const { PQfinish(connection); }
  };
  explicit PostgresConnection(PostgresOptions options) : options_(std::move(options)), lab_(options_.lab) {}
  /// `takes_locks`: those of `others` and `only_one_named`, where the options say so.
  Status connect(bool takes_locks = true);
  [[nodiscard]] bool hasLocks() const { return options_.others != PostgresOptions::Others::kAll; }
  void tellBefore(std::string_view sql) const {
    if (options_.before_statement) options_.before_statement(sql);
  }
  /// Takes kAloneLock, and the one of its name; waits for them for 2 s at most.
  Status takeLocks();
  Result<bool> tryLock(const std::string& sql);
  /// Has the connection read only where the options say so, and reads the settings and, where lab_ says which
  /// one it must be, what the database is; in one round trip.
  Status settle();
  /// kUnavailable unless a row's columns, from `column` on, say that it is lab_'s database.
  Status requireLab(const PGresult* row, int column) const;
  /// Notes the settings in a row's columns, from `column` on (kSettingsQuery).
  void noteSettings(const PGresult* row, int column);
  /// kUnavailable when an ack would survive less than it must.
  Status requireDurable() const;
  struct Waiting {
    std::chrono::steady_clock::time_point until;
    bool asked_to_end = false;
  };
  /// Waits for the next result of what was sent; null: there is none. Ends early with kUnavailable when
  /// cancelled, or when no answer comes.
  Result<ResultPtr> nextResult(Waiting& waiting, std::string_view what);
  /// Waits for all results of what was sent; the last one is returned.
  Result<ResultPtr> wait(std::string_view what);
  /// The result unless it is an error; notes changes().
  Result<ResultPtr> checked(ResultPtr last, std::string_view what);
  /// Sends what is due, and behind it what `send` sends (a call of libpq that is 0 when it fails); returns
  /// that one's result.
  Result<ResultPtr> behindDue(const std::function<int()>& send, std::string_view what);
  /// Ends what was sent in pipeline mode, waits for its results, and leaves that mode. `take` gets each one's
  /// result, but none of those that were not run because one before them failed.
  Status endPipeline(std::string_view what, const std::function<void(ResultPtr)>& take);
  Status sendDue();
  void dropDue();
  Status requireSound(const char* what);
  /// Sends BEGIN, what takes the lock, and the statement behind it, in pipeline mode. Returns how many
  /// results these have; 0: it could not.
  int sendBegin();
  /// Takes the result of one of these, which succeeded.
  void noteBegin(std::size_t step, std::size_t steps, const PGresult* result);
  /// Rolls back; whatever is asked until the caller rolls back, too, has this error.
  Error notBegun(Error why);
  Status runText(const char* sql);
  Error errorOf(const PGresult* result, std::string_view what);
  Error lost(std::string_view what);
  static void noteNotice(void* self, const PGresult* notice);
  /// COMMIT's result.
  Result<ResultPtr> runCommit();
  /// The same; the settings are read behind it, in the same round trip.
  Result<ResultPtr> commitAndReadSettings();
  /// "committed", "aborted", "in progress", "" (too long ago), or "unknown": this server never had it.
  Result<std::string> statusOf(const std::string& xid);
  /// Notes in lack_ whether this server has the last transaction that was acknowledged.
  Status lookBack();
  /// What became of the transaction `xid`, whose COMMIT had no answer.
  Status askOutcome(const std::string& xid);

  const PostgresOptions options_;
  std::string shown_url_;
  std::optional<LabIdentity> lab_;  ///< of each connection from now on
  PostgresSettings settings_;       ///< of the last write transaction, or connection
  std::unique_ptr<PGconn, ConnectionCloser> connection_;
  const std::atomic<bool>* cancelled_ = nullptr;
  std::int64_t changes_ = 0;
  std::function<bool()> while_waiting_;
  std::uint64_t epoch_ = 0, prepared_ = 0;
  std::uint64_t times_connected_ = 0;  ///< of epoch_ those that succeeded, and were no question only
  std::uint64_t round_trips_ = 0;      ///< without those of connecting
  std::uint64_t settings_epoch_ = 0;   ///< the statement behind the lock is prepared there
  bool damaged_ = false;
  bool in_lost_transaction_ = false;  ///< the connection was lost within one that has not been rolled back
  bool in_transaction_ = false;       ///< begin() succeeded, and neither commit() nor rollback() came
  bool is_beside_ = false;            ///< of kBeside: it may have written, though it has no write_xid_
  bool begin_due_ = false;            ///< BEGIN goes with the next statement
  std::optional<Error> not_begun_;    ///< of a BEGIN that went so, until rollback()
  bool saw_writer_table_ = false;     ///< kWriterTable, in the last write transaction
  bool is_alone_ = false;             ///< has kAloneLock exclusively, and again after a reconnection
  std::string write_xid_;             ///< of the write transaction under way
  std::string acknowledged_xid_;      ///< the last one that commit() returned success for
  std::string lack_, full_;
  std::optional<std::string> warning_;  ///< since the last commit began
  enum class AtSavepoint { kNone, kDue, kMade, kBegin };
  AtSavepoint savepoint_ = AtSavepoint::kNone;
  std::vector<const char*> due_;  ///< statements without results that go with the next one
  static constexpr std::size_t kMostNamed = 512;
  std::size_t named_ = 0;  ///< names that PostgreSQL knows, those of given_up_ too
  std::vector<std::string> given_up_;
  std::size_t due_done_ = 0;  ///< how many of due_ behindDue() has done
  ResultsSoFar results_;
  bool lacks_resources_ = false;  ///< an error of class 53 came: memory, room, places for connections
};

}  // namespace needlelab
