/// Requests of people and stations, executed on the store: the same code in the running server and in
/// `needlelab-admin --data DIR`.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/audit.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "db/service/export_ledger.h"
#include "db/service/reference_paths.h"
#include "db/service/requests.h"
#include "db/service/retention.h"
#include "db/service/session_samples.h"
#include "db/session_store.h"
#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"

namespace needlelab {
namespace handlers {
struct Context;
}

/// The outcome of a request.
struct Outcome {
  pb::Reply reply;  ///< with the request's id
  std::optional<Error>
      error;  ///< set: the request was refused (wire/refusal.h translates), `reply` holds only the id
  ServerPart server_part = ServerPart::kNone;
};

/// The outcome of a station's request to close a session.
struct CloseOutcome {
  Closed closed;
  std::string score_json;   ///< when taken: the measures, stored; empty when there is nothing to measure
  std::string score_fault;  ///< why it could not be scored; the session is closed nevertheless
};

/// Thread: every function is thread-safe and blocks (reads: milliseconds; writes: until the commit;
/// passwords: about 0.1 s of argon2id and 64 MiB; backup, check, closing: as long as there is data to read).
/// Call them on worker threads, never on the network's. Owns nothing: writer and readers must outlive it.
class Service {
 public:
  Service(DbWriter& writer, ReaderPool& readers) : writer_(writer), readers_(readers) {}

  /// Checks the role (requests.h), executes, writes the audit log.
  Outcome execute(const Principal& principal, const pb::Request& request);

  /// The program ends: backups, checks and verifications under way, and later ones, are given up. Thread:
  /// any.
  void cancelLongWork() { cancelled_ = true; }

  /// Password check. kDenied with one text for unknown, wrong and disabled, in about the same time.
  Result<Principal> loginPerson(const std::string& user, const std::string& password);
  /// Station key check. kDenied as above.
  Result<Principal> loginStation(const std::string& station, const std::string& key);
  /// False when a person was disabled or changed its role, or a station was revoked, since its log-in: for
  /// tokens.
  Result<bool> stillAllowed(const Principal& principal);

  /// Hashes the stored chunks on a reader, closes on the writer, then scores and stores score and events.
  /// Returns after the commit.
  Result<CloseOutcome> closeSession(const pb::CloseSession& request, const std::string& station);

  /// Measures of a session's gesture (common/scoring/README.md) as JSON rows, from its stored chunks and the
  /// profile it ran with. kInvalidInput: the profile text is not valid, or the gesture is longer than
  /// kMaxScoredSamples.
  Result<std::string> scoreSession(Connection& reader, const Uuid& session);

  /// One run of retention (retention.h): minutes to hours. kUnavailable, at once: another one is under way,
  /// since when and by whom. A dry run reads only and waits for nobody.
  Result<pb::RetentionReport> retention(const std::string& by_whom, bool dry_run);
  /// As the server does it by itself each day, in the name "retention". kUnavailable as well when the last
  /// run was not within the last 31 days: a clock that has jumped must not delete anything; a run that
  /// somebody asks for says that the clock is right.
  Result<pb::RetentionReport> dailyRetention();
  /// Scores the sessions that have no score of the current definitions (rescoring.h): minutes to hours.
  /// kUnavailable: another one is under way.
  Result<pb::RescoreReport> rescoreAll(const std::string& by_whom, const pb::RescoreAll& call);
  /// A run of either that is under way ends within a piece of work, and no other begins.
  void stopRetention() { stop_retention_.store(true, std::memory_order_relaxed); }
  /// Before the first run.
  void setRetentionPace(const RetentionPace& pace) { retention_pace_ = pace; }

  /// People who were erased and are in this database again, because a backup from before was restored: what
  /// to do, a sentence each.
  Result<std::vector<std::string>> erasuresToRepeat();

  // --- for the rows of requests.cpp

  /// Calls `work` with a reader that is borrowed for it.
  Result<pb::Reply> withReader(const Principal& who, std::string_view action,
                               const std::function<Result<pb::Reply>(const handlers::Context&)>& work);
  /// One backup at a time. kUnavailable: another one is under way.
  Result<pb::Reply> backup(const Principal& who, const pb::Backup& call);
  /// The erasure, and at once the chunks that it gave up; while a run of retention is under way, the next run
  /// takes them.
  Result<pb::Reply> erasePerson(const Principal& who, const pb::ErasePerson& call);
  /// Scores a closed session again by the definitions of this program and keeps that beside the first score.
  Result<pb::Reply> rescore(const Principal& who, const pb::RescoreSession& call);
  Result<pb::Reply> rescoreAllNow(const Principal& who, const pb::RescoreAll& call);
  Result<pb::Reply> runRetentionNow(const Principal& who, const pb::RunRetention& call);

  /// Writes a line to the audit log, e.g. refused log-ins and chunks that contradict stored ones.
  Status note(const std::string& who, const std::string& action, const std::string& subject,
              const std::string& detail);

 private:
  struct Settled {
    std::string score_json;      ///< empty when there is nothing to measure
    std::optional<Error> fault;  ///< why it could not be scored
    bool final = false;          ///< … and never can be: too long, or its profile is not valid
  };
  /// Works out score and events of a closed session and stores them. Errors: the database's.
  Result<Settled> settle(Connection& reader, const Uuid& session);
  /// The same before its recording is thinned or deleted, where something is missing. An error where the
  /// fault may pass (memory, an exercise that is imported again …): the original must stay for it.
  Status settleRecording(const Uuid& session);
  [[nodiscard]] RetentionTools retentionTools();
  /// Removes the chunks that an erasure gave up. What is left of them, and why, as a sentence; empty:
  /// nothing.
  std::string removeErased();
  /// Empty when there is nothing to measure.
  Result<std::string> scoreOf(Connection& reader, const SessionSamples& session);
  DbWriter& writer_;
  ReaderPool& readers_;
  ExportLedger exports_;
  std::atomic<bool> cancelled_{false};
  std::mutex backup_mutex_;  ///< one backup at a time
  std::atomic<bool> backup_running_ = false;
  std::mutex retention_mutex_;  ///< guards the text below; never held for long
  std::string retention_run_;   ///< of the run that is under way: "since … by …"; one at a time
  ReferencePaths reference_paths_;
  std::mutex rescore_mutex_;  ///< one run at a time
  std::atomic<bool> stop_retention_ = false;
  RetentionPace retention_pace_;
};

}  // namespace needlelab
