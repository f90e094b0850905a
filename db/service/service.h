/// Executes requests of people and stations on the store: the same code in the running server and in
/// `needlelab-admin --data DIR`.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/login/shared_logins.h"
#include "db/service/context/audit_notes.h"
#include "db/service/context/backups.h"
#include "db/service/context/code_tries.h"
#include "db/service/context/context.h"
#include "db/service/context/export_ledger.h"
#include "db/service/context/logins.h"
#include "db/service/context/long_work.h"
#include "db/service/records/erasures.h"
#include "db/service/records/retention_runs.h"
#include "db/service/requests/requests.h"
#include "db/service/scoring/rescoring.h"
#include "db/service/scoring/session_scoring.h"
#include "db/sessions/db_writer.h"
#include "db/store/duties.h"
#include "db/store/store_address.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// The outcome of a request.
struct Outcome {
  pb::Reply reply;             ///< with the request's id
  std::optional<Error> error;  ///< set: the request was refused, and `reply` holds only the id (refusalOf in
                               ///< common/wire/protocol.h translates)
  ServerPart server_part = ServerPart::kNone;
  /// The account or station that the request names is (or already was) disabled or revoked, or its role or
  /// password changed. Also set, with `error`, if the change was in a transaction that then failed, because
  /// it may still have been carried out. Not set by an erasure, whose reply contains this.
  bool access_changed = false;
  /// The requester has changed its own access and continues with this number (Principal::access_number).
  std::optional<std::int64_t> access_number{};
  std::shared_ptr<const pb::Request> with_refs{};  ///< the request, with refs; null: refused before
  std::vector<std::string> roles_changed{};        ///< by an import: refs of people whose role changed
};

/// The table's requests on one store, and the parts shared with the server. Thread: every function is
/// thread-safe and blocks (reads: milliseconds; writes: until the commit; passwords: about 0.1 s of argon2id
/// and 64 MiB; backup, check, closing: in proportion to the data). Call them on worker threads, never on the
/// network's. Does not own writer and readers, which must outlive it.
class Service {
 public:
  /// `time`: times the waits after wrong codes; must outlive the service.
  Service(DbWriter& writer, ReaderPool& readers, TimeSource& time = machineTime())
      : Service(writer, readers, false, std::make_shared<ExportLedger>(),
                std::make_unique<CodesInMemory>(time)) {}
  /// For one of several servers on a database: wrong codes and noted reads are in `shared`, which must
  /// outlive the service, and each log-in gets an access number.
  Service(DbWriter& writer, ReaderPool& readers, SharedLogins& shared)
      : Service(writer, readers, true, std::make_shared<ExportLedger>(shared),
                std::make_unique<CodesInStore>(shared)) {}

  /// Checks the role (requests.h) and, for log-ins, that the account still has it; executes the request and
  /// writes the audit log.
  Outcome execute(const Principal& principal, const pb::Request& request);
  /// Executes one step; most requests have only one. Nothing: call again, after others had their turn. Role
  /// and account are checked in each step until RequestUnderWay::isDone().
  std::optional<Outcome> executeStep(const Principal& principal, const pb::Request& request,
                                     RequestUnderWay& under_way);

  /// At the program's end: cancels current and later backups, checks and verifications. Thread: any.
  void cancelLongWork() { long_work_.cancelled = true; }

  /// Ends a retention or rescoring run after its current piece of work, and prevents further runs.
  void stopRetention() { long_work_.is_stopped.store(true, std::memory_order_relaxed); }
  /// Call before the first run.
  void setRetentionPace(const RetentionPace& pace) { long_work_.pace = pace; }
  /// For when other servers work on the database, too: work that only one of them may do at a time is
  /// coordinated through Duties. Call before the first request.
  void shareDuties(StoreAddress address) { long_work_.duties = std::make_unique<Duties>(std::move(address)); }

  [[nodiscard]] Logins& logins() { return logins_; }
  [[nodiscard]] AuditNotes& notes() { return notes_; }
  [[nodiscard]] SessionScoring& scoring() { return scoring_; }
  [[nodiscard]] RetentionRuns& retention() { return retention_; }
  [[nodiscard]] Erasures& erasures() { return erasures_; }
  [[nodiscard]] Backups& backups() { return backups_; }
  /// Everything that handlers use.
  [[nodiscard]] const ServiceParts& parts() const { return parts_; }

 private:
  Service(DbWriter& writer, ReaderPool& readers, bool together, std::shared_ptr<ExportLedger> exports,
          std::unique_ptr<CodeTries> codes);

  ReaderPool& readers_;
  const std::shared_ptr<ExportLedger> exports_;  // shared with the writer's items
  const std::unique_ptr<CodeTries> codes_;
  LongWork long_work_;
  Backups backups_;
  Logins logins_;
  AuditNotes notes_;
  SessionScoring scoring_;
  RescoringRuns rescoring_;
  RetentionRuns retention_;
  Erasures erasures_;
  const ServiceParts parts_;
};

}  // namespace needlelab
