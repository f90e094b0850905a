// PostgreSQL transactions: BEGIN with the writer's lock, COMMIT, and the outcome of a COMMIT without an
// answer.
#include <fmt/core.h>

#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "common/base/planted_bug.h"
#include "db/engine/postgres.h"

namespace needlelab {
namespace {

/// Name of the prepared statement sent after the lock.
constexpr const char* kSettingsStatement = "settings";

/// Takes the writer's lock. Readers and pg_dump do not wait for it. The block that looks for the table costs
/// 0.14 ms (including its effect on COMMIT), so it is omitted once the table was seen.
std::string lockText(bool saw_table) {
  const std::string locks = fmt::format("LOCK TABLE {} IN EXCLUSIVE MODE", kWriterTable);
  if (saw_table) return locks;
  return fmt::format(
      "DO $$BEGIN IF to_regclass('{0}') IS NULL THEN PERFORM pg_advisory_xact_lock({1});"
      " ELSE {2}; END IF; END$$",
      kWriterTable, kWriterLock, locks);
}

}  // namespace

bool PostgresConnection::inTransaction() const {
  if (in_lost_transaction_ || begin_due_) return true;
  if (!isConnected()) return false;
  const auto status = PQtransactionStatus(connection_.get());
  return status == PQTRANS_INTRANS || status == PQTRANS_INERROR;
}

Status PostgresConnection::begin(Begin kind) {
  not_begun_.reset();
  is_side_ = kind == Begin::kSide;
  RETURN_IF_ERROR(requireConnected());
  notifyBeforeStatement("BEGIN");
  if (kind == Begin::kView) {
    RETURN_IF_ERROR(runText("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"));
    // BEGIN alone does not read; this fixes the view
    Status fixed = runText("SELECT 1");
    if (!fixed) rollback();
    in_transaction_ = fixed.ok();
    return fixed;
  }
  if (is_side_) {
    const Status begun = runText("BEGIN ISOLATION LEVEL READ COMMITTED");
    in_transaction_ = begun.ok();
    return begun;
  }
  begin_due_ = true;
  if (kind == Begin::kWrite) {
    const Status begun = sendDue();
    not_begun_.reset();  // the caller has no transaction to roll back
    if (!begun) return begun;
  }
  in_transaction_ = true;
  return {};
}

int PostgresConnection::sendBegin() {
  PGconn* const connection = connection_.get();
  // in this order: statements after the lock then see everything the previous holder committed
  if (PQsendQueryParams(connection, "BEGIN ISOLATION LEVEL READ COMMITTED", 0, nullptr, nullptr, nullptr,
                        nullptr, 0) == 0)
    return 0;
  const bool prepares = settings_epoch_ != epoch_;
  // The message makes COMMIT wait for disk and standby even if nothing changed. Otherwise it would
  // acknowledge data of an earlier transaction that only the primary has (RecordTransactionCommit,
  // wrote_xlog).
  const std::string settings = fmt::format(
      "SELECT pg_current_xact_id()::text, to_regclass('{}') IS NOT NULL, {},"
      " pg_logical_emit_message(true, 'needlelab', '')",
      kWriterTable, kSettingsQuery);
  if (prepares && PQsendPrepare(connection, kSettingsStatement, settings.c_str(), 0, nullptr) == 0) return 0;
  const std::string lock =
      planted(PlantedBug::kWritersTogether) ? "DO $$BEGIN END$$" : lockText(saw_writer_table_);
  if (PQsendQueryParams(connection, lock.c_str(), 0, nullptr, nullptr, nullptr, nullptr, 0) == 0) return 0;
  if (PQsendQueryPrepared(connection, kSettingsStatement, 0, nullptr, nullptr, nullptr, 0) == 0) return 0;
  return prepares ? 4 : 3;
}

void PostgresConnection::noteBegin(std::size_t step, std::size_t steps, const PGresult* result) {
  if (step + 1 == steps) {
    saw_writer_table_ = *PQgetvalue(result, 0, 1) == 't';
    noteSettings(result, 2);
    write_xid_ = PQgetvalue(result, 0, 0);
  } else if (step == 1) {
    settings_epoch_ = epoch_;  // prepared now or earlier
  }
}

Error PostgresConnection::notBegun(Error why) {
  rollback();
  saw_writer_table_ = false;  // it may be gone
  not_begun_ = why;
  return why;
}

Status PostgresConnection::commit() {
  if (not_begun_) return *not_begun_;
  dropDue();  // COMMIT ends the savepoints, too
  // no statement was sent, but earlier commits must still be safe
  if (begin_due_) RETURN_IF_ERROR(sendDue());
  warning_.reset();
  if (in_lost_transaction_) return requireConnected();
  notifyBeforeStatement("COMMIT");
  const std::string xid = std::exchange(write_xid_, {});
  in_transaction_ = false;  // if the connection is lost from here on, the outcome is queried
  // settings read before the COMMIT may not be those under which its wait ended
  const bool reads_settings = !xid.empty() && options_.least == Durability::kDiskLoss;
  const auto done = reads_settings ? commitAndReadSettings() : runCommit();
  if (done) {
    if (std::strcmp(PQcmdStatus(done->get()), "COMMIT") != 0)
      return Error{ErrorCode::kFailed, shown_url_ + ": the transaction had failed, and was rolled back"};
    if (warning_ && !planted(PlantedBug::kWarningIgnored))
      return Error{ErrorCode::kUnavailable,
                   fmt::format("{}: stored at the primary only: {}", shown_url_, *warning_)};
    if (reads_settings && durability() < options_.least)
      return Error{ErrorCode::kUnavailable, fmt::format("{}: stored, but perhaps at the primary only: {}",
                                                        shown_url_, settings_.text())};
    if (!xid.empty()) acknowledged_xid_ = xid;
    return {};
  }
  if (isConnected()) return done.error();
  if (is_side_) return done.error();  // counting again could count twice
  if (xid.empty()) return {};         // it only read
  const Status outcome = queryOutcome(xid);
  if (hasLocks()) connection_.reset();  // the next connection takes them
  return outcome;
}

Result<PostgresConnection::ResultPtr> PostgresConnection::runCommit() {
  if (PQsendQuery(connection_.get(), "COMMIT") == 0) return lost("commit");
  return wait("commit");
}

Result<PostgresConnection::ResultPtr> PostgresConnection::commitAndReadSettings() {
  constexpr const char* kWhat = "commit";
  PGconn* const connection = connection_.get();
  if (PQenterPipelineMode(connection) == 0) return lost(kWhat);
  // PostgreSQL notifies its connections of new settings before it ends their waits, and a connection applies
  // them before each message
  for (const std::string& sql : {std::string("COMMIT"), fmt::format("SELECT {}", kSettingsQuery)})
    if (PQsendQueryParams(connection, sql.c_str(), 0, nullptr, nullptr, nullptr, nullptr, 0) == 0)
      return lost(kWhat);
  ResultPtr committed, settings;
  RETURN_IF_ERROR(endPipeline(
      kWhat, [&](ResultPtr result) { (committed == nullptr ? committed : settings) = std::move(result); }));
  ASSIGN_OR_RETURN(committed, checked(std::move(committed), kWhat));
  ASSIGN_OR_RETURN(settings, checked(std::move(settings), "read its settings"));
  noteSettings(settings.get(), 0);
  return committed;
}

Result<std::string> PostgresConnection::statusOf(const std::string& xid) {
  constexpr const char* kWhat = "ask what became of a transaction";
  const std::string ask = fmt::format("SELECT pg_xact_status('{}'::xid8)", xid);
  if (PQsendQuery(connection_.get(), ask.c_str()) == 0) return lost(kWhat);
  const auto answer = wait(kWhat);
  // the number lies in this server's future: a standby was promoted without that transaction
  if (!answer && answer.error().code == ErrorCode::kInvalidInput) return std::string("unknown");
  if (!answer) return answer.error();
  return std::string(PQgetvalue(answer->get(), 0, 0));
}

Status PostgresConnection::checkLastAcknowledged() {
  if (acknowledged_xid_.empty()) return {};
  const auto status = statusOf(acknowledged_xid_);
  if (!status) {
    connection_.reset();  // the next one checks again
    return status.error();
  }
  if (*status == "committed" || status->empty()) return {};
  lack_ = fmt::format(
      "{}: this server of PostgreSQL does not have all that was acknowledged (transaction {}, the last one, "
      "is "
      "{} here): a standby that lagged was promoted, or an older backup restored. Stations send again what "
      "their spools have. If a server of PostgreSQL that has all is left, end needlelab-server and go back "
      "to it",
      shown_url_, std::exchange(acknowledged_xid_, {}), *status);
  return {};
}

Status PostgresConnection::queryOutcome(const std::string& xid) {
  const auto until = std::chrono::steady_clock::now() + options_.answer_timeout;
  std::string why;
  while (std::chrono::steady_clock::now() < until && (cancelled_ == nullptr || !cancelled_->load())) {
    // without locks: PostgreSQL may still hold the lost connection, and its locks
    if (const auto connected = connect(false); !connected) {
      why = connected.error().message;
    } else if (const auto status = statusOf(xid); !status) {
      why = status.error().message;
    } else {
      // for a transaction that waited for a standby, it is unknown whether the standby has it
      if (*status == "committed")
        return Error{ErrorCode::kUnavailable,
                     shown_url_ +
                         ": the connection was lost while it was stored; it is stored at this server of "
                         "PostgreSQL, and it is unknown whether the standby has it, too"};
      if (*status == "aborted" || *status == "unknown")
        return Error{ErrorCode::kUnavailable, shown_url_ + ": the connection was lost; nothing was stored"};
      why = "it is still under way";
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return Error{ErrorCode::kUnavailable,
               fmt::format("{}: the connection was lost while it was stored, and it is unknown whether it "
                           "was ({}): look before you try again",
                           shown_url_, why)};
}

void PostgresConnection::rollback() {
  write_xid_.clear();
  not_begun_.reset();
  begin_due_ = false;
  dropDue();
  in_transaction_ = false;
  if (std::exchange(in_lost_transaction_, false)) return;
  if (inTransaction()) (void)runText("ROLLBACK");
}

}  // namespace needlelab
