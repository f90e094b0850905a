// PostgreSQL savepoints. The results of SAVEPOINT and RELEASE are not needed, so both are sent together with
// the next statement (libpq's pipeline mode).
#include <algorithm>
#include <cstddef>
#include <utility>

#include "db/engine/postgres.h"

namespace needlelab {

void PostgresConnection::dropDue() {
  due_.clear();
  savepoint_ = AtSavepoint::kNone;
}

/// Whether a savepoint can be made or released: PostgreSQL refuses both in a failed transaction.
Status PostgresConnection::requireSound(const char* what) {
  if (not_begun_) return *not_begun_;
  if (in_lost_transaction_ || !isConnected()) return lost(what);
  if (begin_due_) return {};
  if (PQtransactionStatus(connection_.get()) == PQTRANS_INTRANS) return {};
  return Error{ErrorCode::kFailed, shown_url_ + ": cannot " + what + ": the transaction has failed"};
}

Status PostgresConnection::savepoint() {
  constexpr const char* kMake = "SAVEPOINT item";
  RETURN_IF_ERROR(requireSound(kMake));
  if (begin_due_) {
    savepoint_ = AtSavepoint::kBegin;
    return {};
  }
  due_.push_back(kMake);
  savepoint_ = AtSavepoint::kDue;
  return {};
}

Status PostgresConnection::releaseSavepoint() {
  constexpr const char* kRelease = "RELEASE item";
  RETURN_IF_ERROR(requireSound(kRelease));
  if (savepoint_ == AtSavepoint::kDue) due_.pop_back();
  if (savepoint_ == AtSavepoint::kMade) due_.push_back(kRelease);
  savepoint_ = AtSavepoint::kNone;
  return {};
}

Status PostgresConnection::undoSavepoint() {
  const AtSavepoint at = std::exchange(savepoint_, AtSavepoint::kNone);
  if (at == AtSavepoint::kDue && !due_.empty()) due_.pop_back();
  const bool goes_back = at == AtSavepoint::kMade || (at == AtSavepoint::kBegin && !begin_due_);
  // without a savepoint a failed transaction stays failed, and its end reports that
  if (!goes_back || in_lost_transaction_ || !inTransaction()) return {};
  const bool whole = at == AtSavepoint::kBegin;
  const Status undone = runText(whole ? "ROLLBACK" : "ROLLBACK TO item; RELEASE item");
  if (in_lost_transaction_) return {};  // lost with the connection
  RETURN_IF_ERROR(undone);
  if (!whole) return {};
  write_xid_.clear();
  begin_due_ = true;
  return {};
}

Status PostgresConnection::sendDue() {
  if (due_.empty() && !begin_due_) return {};
  const auto sent = behindDue({}, begin_due_ ? "begin a transaction" : due_.back());
  return sent ? Status() : Status(sent.error());
}

Status PostgresConnection::endPipeline(std::string_view what, const std::function<void(ResultPtr)>& take) {
  PGconn* const connection = connection_.get();
  if (PQpipelineSync(connection) == 0) return lost(what);
  // one result and an end per statement; statements after a failed one are not run
  Waiting waiting{std::chrono::steady_clock::now() + options_.answer_timeout};
  ++round_trips_;
  for (;;) {
    ASSIGN_OR_RETURN(ResultPtr next, nextResult(waiting, what));
    if (next == nullptr) {
      if (!isConnected()) return lost(what);
      continue;
    }
    const ExecStatusType status = PQresultStatus(next.get());
    if (status == PGRES_PIPELINE_SYNC) break;
    if (status != PGRES_PIPELINE_ABORTED) take(std::move(next));
  }
  if (PQexitPipelineMode(connection) == 0) return lost(what);
  return {};
}

Result<PostgresConnection::ResultPtr> PostgresConnection::behindDue(const std::function<int()>& send,
                                                                    std::string_view what) {
  PGconn* const connection = connection_.get();
  due_done_ = 0;
  if (due_.empty() && !begin_due_) {
    if (send() == 0) return lost(what);
    return wait(what);
  }
  if (PQenterPipelineMode(connection) == 0) return lost(what);
  std::size_t begins = 0;  // results that precede those of due_
  if (std::exchange(begin_due_, false)) {
    begins = static_cast<std::size_t>(sendBegin());
    if (begins == 0) return lost(what);
  }
  const std::size_t due = begins + due_.size();
  for (const char* const sql : due_)
    if (PQsendQueryParams(connection, sql, 0, nullptr, nullptr, nullptr, nullptr, 0) == 0) return lost(what);
  due_.clear();
  if (send && send() == 0) return lost(what);
  ResultPtr last;
  std::size_t done = 0;
  RETURN_IF_ERROR(endPipeline(what, [&](ResultPtr next) {
    const ExecStatusType status = PQresultStatus(next.get());
    if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) {
      if (done < begins) noteBegin(done, begins, next.get());
      ++done;
    }
    last = std::move(next);
  }));
  due_done_ = std::min(done - std::min(done, begins), due - begins);
  if (done < begins) return notBegun(errorOf(last.get(), "begin a transaction"));
  if (begins > 0)
    if (const Status durable = requireDurable(); !durable) return notBegun(durable.error());
  // the savepoint comes last in due_
  if (savepoint_ == AtSavepoint::kDue) savepoint_ = done >= due ? AtSavepoint::kMade : AtSavepoint::kNone;
  return checked(std::move(last), what);
}

}  // namespace needlelab
