/// Executes requests of people and stations on the store: the same code in the running server and in
/// `needlelab-admin --data DIR`.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/base/physical_disks.h"
#include "common/base/result.h"
#include "common/base/time_source.h"
#include "common/base/uuid.h"
#include "db/access_numbers.h"
#include "db/audit.h"
#include "db/db_writer.h"
#include "db/duties.h"
#include "db/encrypted_backup.h"
#include "db/reader_pool.h"
#include "db/service/code_tries.h"
#include "db/service/export_ledger.h"
#include "db/service/reference_paths.h"
#include "db/service/requests.h"
#include "db/service/retention.h"
#include "db/service/running_hashes.h"
#include "db/service/session_samples.h"
#include "db/service/session_score.h"
#include "db/session_store.h"
#include "db/shared_logins.h"
#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"

namespace needlelab {
namespace handlers {
struct Context;
}
struct ErasureUnderWay;

/// A run of retention.
struct RunUnderWay {
  Doer by_whom;
  std::int64_t begun_unix_ns = 0;
};

/// The outcome of a request.
struct Outcome {
  pb::Reply reply;             ///< with the request's id
  std::optional<Error> error;  ///< set: the request was refused (refusalOf in common/wire/protocol.h
                               ///< translates), `reply` holds only the id
  ServerPart server_part = ServerPart::kNone;
  /// The account or station that the request names is disabled or revoked, be it so already, or got another
  /// role or password by this request. With `error`, too, where it was changed in a transaction that failed
  /// afterwards: nobody may know whether that was carried out. Not set by an erasure, whose reply says it.
  bool access_changed = false;
  /// The asker has changed its own access, and goes on with this one (Principal::access_number).
  std::optional<std::int64_t> access_number{};
  std::shared_ptr<const pb::Request> with_refs{};  ///< the request, with refs; null: it was refused before
  std::vector<std::string> roles_changed{};        ///< by an import: refs of people with another role
};

/// What one step of VerifySession reads, as SessionStore::hashOn() counts: some 80 ms, in which an import of
/// a class or a backup waits for it. Smaller: more looks at the session's row; greater: longer waits.
inline constexpr std::uint64_t kVerifiedBytesAtOnce = std::uint64_t{16} << 20;

/// What one step of a score does, as StepWork counts: some 50 ms, in which whoever comes next waits for it.
/// Smaller: more looks at the session's row; greater: longer waits.
inline constexpr std::uint64_t kScoredAtOnce = 250'000;

/// How many pieces of an erased person's chunks (RetentionPace) one step removes: some 0.3 s, in which an
/// import or a backup waits. Smaller: more looks at what is left; greater: longer waits.
inline constexpr std::size_t kErasedPiecesAtOnce = 8;

/// A request between the steps of its work.
struct RequestUnderWay {
  std::shared_ptr<const pb::Request> with_refs{};  ///< the request, once toRefs() was applied
  std::map<std::string, std::string> written{};    ///< as persons were named in it, by ref
  bool access_changed = false;                     ///< as in Outcome
  std::optional<std::int64_t> access_number{};     ///< as in Outcome
  bool more = false;                         ///< set by a handler: this was a step, and its reply is none yet
  std::optional<SessionCheckSoFar> check{};  ///< of VerifySession
  std::shared_ptr<SessionScore> score{};     ///< of RescoreSession
  std::shared_ptr<SessionEvents> events{};   ///< of ListEvents, where none are stored
  bool is_long = false;                      ///< of these two: the next step waits for a place
  /// Of ErasePerson: the person is erased.
  std::shared_ptr<ErasureUnderWay> erasure{};
  /// What was asked for is done: the steps that are left complete the reply, by which others are told, too.
  [[nodiscard]] bool isDone() const { return erasure != nullptr; }
};

/// The outcome of a station's request to close a session.
struct CloseOutcome {
  Closed closed;
  std::string score_json;  ///< when taken: the stored measures; empty when there is nothing to measure, or an
                           ///< exam's results are held back (held_results.h)
  std::string score_fault;        ///< the reason when scoring failed; the session is closed nevertheless
  std::uint64_t event_bytes = 0;  ///< of the syringe's events that were stored now
};

/// The score of such a session is one step: some 0.1 s of a thread, and 22 MB at 1 kHz. That of a longer one
/// takes up to some 3 s, in steps of kScoredAtOnce, between which it holds up to 110 MB (SessionScore).
/// Smaller: more closes take turns on fewer threads; greater: a short session's close waits for longer ones.
inline constexpr std::uint64_t kShortScoreSamples = 100'000;

/// A station's request to close a session, between the steps of its work.
struct CloseUnderWay {
  pb::CloseSession request;
  std::string station;             ///< empty: any
  std::uint32_t looked_again = 0;  ///< because chunks came meanwhile
  /// It is closed: its score is not made yet, and not all distances that it needs are computed.
  std::optional<CloseOutcome> unscored{};
  std::shared_ptr<SessionScore> score{};  ///< as far as it is made
  /// What is left is the score of a session of more than kShortScoreSamples.
  bool is_long = false;
  /// By which it came, as ArrivedChunk::claim; nothing of it is stored once the station has logged in again.
  std::shared_ptr<const StationClaim> claim{};
};

/// Thread: every function is thread-safe and blocks (reads: milliseconds; writes: until the commit;
/// passwords: about 0.1 s of argon2id and 64 MiB; backup, check, closing: in proportion to the data). Call
/// them on worker threads, never on the network's. Does not own writer and readers, which must outlive it.
class Service {
 public:
  /// `time`: by which wrong codes wait; it must outlive the service.
  Service(DbWriter& writer, ReaderPool& readers, TimeSource& time = machineTime())
      : writer_(writer), readers_(readers), codes_(std::make_unique<CodesInMemory>(time)) {}
  /// Of a server of several on one database: wrong codes and noted reads are in `shared`, which must outlive
  /// it, and whoever logs in gets an access number.
  Service(DbWriter& writer, ReaderPool& readers, SharedLogins& shared)
      : writer_(writer),
        readers_(readers),
        shared_(&shared),
        exports_(std::make_shared<ExportLedger>(shared)),
        codes_(std::make_unique<CodesInStore>(shared)) {}

  /// Checks the role (requests.h) and, of who logged in, that the account still has it; executes the request
  /// and writes the audit log.
  Outcome execute(const Principal& principal, const pb::Request& request);
  /// Does one step of it, which most requests have only one of. Nothing: call it again, after others had
  /// their turn. The role and the account are checked in each step until RequestUnderWay::isDone().
  std::optional<Outcome> executeStep(const Principal& principal, const pb::Request& request,
                                     RequestUnderWay& under_way);

  /// At the program's end: cancels running and later backups, checks and verifications. Thread: any.
  void cancelLongWork() { cancelled_ = true; }

  /// Checks a password. kDenied with the same text, in about the same time, for unknown, wrong and disabled.
  /// kFailed: it could not be checked, for want of memory.
  Result<Principal> loginPerson(const std::string& user, const std::string& password);
  /// Checks a station's key. kDenied as above.
  Result<Principal> loginStation(const std::string& station, const std::string& key);
  /// A principal for the person with this account name, as if it had logged in with its password. Nothing:
  /// there is none.
  Result<std::optional<Principal>> principalOf(const std::string& name);
  /// What the person is called now; the name of a station or program.
  Result<std::string> shownNameOf(const std::string& ref);
  /// What else was typed as a station's name may be a password and is not logged.
  Result<bool> isKnownStation(const std::string& name);
  /// For tokens: false when, since log-in, a person was disabled or changed its role, or a station was
  /// revoked.
  Result<bool> stillAllowed(const Principal& principal);
  /// The same of many, in their order.
  Result<std::vector<bool>> stillAllowed(const std::vector<Principal>& all);

  /// Does one step of a close: hashes some more of the stored chunks (RunningHashes) on a reader; closes the
  /// session on the writer; computes some more of its distances from references (ReferencePaths) and, once
  /// all are known, some more of its score (SessionScore); at last stores score and events. Nothing: call it
  /// again, after others had their turn; before a long score, too, so that it is made where nobody waits for
  /// it. Whoever does not may close the session again, later: that goes on where this ended, but makes the
  /// score anew. Returns the outcome after the commit. Chunks
  /// that were hashed once are not read again for another close, whatever became of the first. A session that
  /// could not be scored gets the same answer when it is closed again, and is not read again for it.
  /// kUnavailable: chunks came again and again meanwhile; kDeposed: as CloseUnderWay::claim.
  Result<std::optional<CloseOutcome>> closeStep(CloseUnderWay& close);
  /// All steps.
  Result<CloseOutcome> closeSession(const pb::CloseSession& request, const std::string& station);
  /// Bytes of chunks that closes have read for hashes since the start: what they cost.
  [[nodiscard]] std::uint64_t bytesHashed() const { return running_hashes_.bytesHashed(); }

  /// Scores a session's gesture (common/scoring/README.md) from its stored chunks and its profile; returns
  /// JSON rows. kInvalidInput and kCorrupt: as samplesOf(), which is asked once, until recordings are
  /// removed.
  Result<std::string> scoreSession(Connection& reader, const Uuid& session);

  /// Other servers work on the database, too: what one of them does at a time is had from `duties`. Call it
  /// before the first request.
  void shareDuties(StoreAddress address) { duties_ = std::make_unique<Duties>(std::move(address)); }
  /// Puts into DIR/erasures whom other servers erased. Cheap where there is nothing new.
  Status completeErasureList();

  /// One run of retention (retention.h): minutes to hours. Fails at once with kUnavailable while another run
  /// is in progress, here or at another server; the message gives its start and user, if it is here. A dry
  /// run only reads and never waits.
  Result<pb::RetentionReport> retention(const Doer& by_whom, bool dry_run);
  /// The server's daily run, under the name "retention"; nothing: it is another server's. Also kUnavailable
  /// when the last run, or the latest time that is known (seen_time.h), was more than 31 days ago: a clock
  /// that has jumped must not delete anything. A user who starts a run confirms that the clock is right.
  Result<std::optional<pb::RetentionReport>> dailyRetention();
  /// Scores the sessions without a score of the current definitions (rescoring.h): minutes to hours.
  /// kUnavailable: another run is in progress.
  Result<pb::RescoreReport> rescoreAll(const Doer& by_whom, const pb::RescoreAll& call);
  /// Ends a run of retention or rescoring after its current piece of work, and prevents further runs.
  void stopRetention() { stop_retention_.store(true, std::memory_order_relaxed); }
  /// Call before the first run.
  void setRetentionPace(const RetentionPace& pace) { retention_pace_ = pace; }
  /// By which a backup is told from one on another disk. Call before the first backup.
  void setBlockDevices(BlockDevices devices) { disks_ = std::move(devices); }

  /// Makes backups encrypted. Call before the first backup.
  void setBackupKey(BackupKey key) { backup_key_ = std::move(key); }

  /// Forgets what is known of recordings, because some were removed; also by another server.
  void forgetRecordings();

  /// After an erasure: removes the chunks, and has the log emptied. Returns a sentence about what remains.
  /// For a start: nobody is served yet, so it makes no pauses.
  std::string finishErasure();

  /// Distances between the paths of tips that comparisons with references took since the start.
  [[nodiscard]] std::uint64_t distancesComputed() const { return reference_paths_.distancesComputed(); }

  /// What one comparison with a reference may cost (db/service/reference_paths.h). Call before the first one.
  void setMostComparedCells(std::uint64_t cells) { reference_paths_.setMostCells(cells); }

  // --- for the rows of requests.cpp

  /// Calls `work` with a borrowed reader.
  Result<pb::Reply> withReader(const Principal& who, std::string_view action,
                               const std::function<Result<pb::Reply>(const handlers::Context&)>& work);
  /// One backup at a time. kUnavailable: another one is in progress.
  Result<pb::Reply> backup(const Principal& who, const pb::Backup& call);
  /// Erases a person. Further steps remove the chunks (during a run of retention, they leave them to the next
  /// one) and empty the log. The erasure is pending while readers need the log.
  Result<pb::Reply> erasePerson(const Principal& who, const pb::ErasePerson& call,
                                RequestUnderWay& under_way);
  /// Scores a closed session again by this program's definitions and keeps the result beside the first score.
  /// In steps.
  Result<pb::Reply> rescore(const Principal& who, const pb::RescoreSession& call, RequestUnderWay& under_way);
  Result<pb::Reply> rescoreAllNow(const Principal& who, const pb::RescoreAll& call);
  Result<pb::Reply> runRetentionNow(const Principal& who, const pb::RunRetention& call);

  /// Writes a line to the audit log, e.g. refused log-ins.
  Status note(const std::string& who, const std::string& action, const std::string& subject,
              const std::string& detail);
  /// The same for lines of which hundreds may come at once: does not wait. Lines that come before the writer
  /// gets to the first of them are one item of its queue; its end still writes them. `failed` hears of a line
  /// that was not stored, on the caller's or the writer's thread. Thread: any.
  void noteSoon(const Doer& who, const std::string& action, const std::string& subject,
                const std::string& detail, std::function<void(const Error&)> failed);
  /// Writes down that `who` begins to watch a station or, if `session` is not empty, a session live: for each
  /// person and what is watched once an hour. Only stations and open sessions that exist get a line, so that
  /// made-up ones fill nothing. Does not wait; thread: any.
  /// `failed`: as in noteSoon(); the next time that `who` watches it has a line then. Where the database can
  /// no longer be written to there is no line.
  void noteWatching(const Principal& who, const std::string& station, const std::string& session,
                    std::function<void(const Error&)> failed);
  /// Writes down that staff or a researcher has logged in from `host`: for each person and host once an hour.
  Status noteLogin(const Principal& who, const std::string& host);

 private:
  struct Settled {
    std::string score_json;      ///< empty when there is nothing to measure
    std::optional<Error> fault;  ///< the reason when scoring failed
    /// The fault is permanent: too long, a motion beyond its bounds, or a profile that is not valid. The
    /// first two get a remark, "cannot be scored: …", and are not read again.
    bool final = false;
    std::uint64_t event_bytes = 0;  ///< as in CloseOutcome
    bool is_pending = false;        ///< nothing is stored yet: there is more to do
  };
  /// Lines of noteSoon() and noteWatching() on their way to the writer, whose queue may outlive the service.
  struct SoonNoted {
    struct Line {
      AuditRow row;
      std::function<void(const Error&)> failed;
      std::function<Result<bool>(Connection&)> wanted{};  ///< whether it is stored; empty: it is
    };
    using Item = std::vector<Line>;
    /// One item of the writer. Where one of its lines cannot be stored, each is tried alone.
    static Status post(DbWriter& writer, const std::shared_ptr<SoonNoted>& noted,
                       const std::shared_ptr<Item>& item);
    /// No further line belongs to this item.
    void end(const std::shared_ptr<Item>& item);
    std::mutex mutex;
    std::shared_ptr<Item> open;  ///< guarded by mutex; null: the next line begins an item
  };
  /// The steps of a close when the session is closed.
  Result<std::optional<CloseOutcome>> scoreStep(Connection& reader, const Uuid& session,
                                                CloseUnderWay& close);
  /// Makes some more of a closed session's score and events, and stores them at its end. Errors: the
  /// database's.
  /// `claim`: as CloseUnderWay::claim; null: nobody's.
  Result<Settled> settle(Connection& reader, const Uuid& session, SessionScore& score, StepWork work,
                         const StationClaim* claim = nullptr);
  Result<Settled> settleOrThrow(Connection& reader, const Uuid& session, SessionScore& score, StepWork work,
                                const StationClaim* claim);
  /// The same before its recording is thinned or deleted, when score or events are missing. Returns an error
  /// for a temporary fault (memory, an exercise that may be imported again …): the original must stay until
  /// it passes.
  Status settleRecording(const Uuid& session);
  [[nodiscard]] RetentionTools retentionTools();
  /// Principal::access_number of whoever logs in now.
  Result<std::optional<std::int64_t>> numberNow(Connection& reader, AccessWhat what,
                                                const std::string& name) const;
  /// Removes some of an erasure's chunks. When `so_far` has no more: returns a sentence about remaining
  /// chunks and the reason; empty: none remain.
  std::string removeErased(const RetentionPace& pace, std::size_t most_pieces, LeftoversSoFar& so_far);
  /// A step of an erasure whose person is erased.
  Result<pb::Reply> eraseOn(RequestUnderWay& under_way);
  /// Has the log emptied. Returns a sentence when readers still need it; empty: nothing of an erasure is
  /// left.
  std::string emptyLogOfErased();
  /// Makes some more of a score, as scoreSession(). Nothing: there is more to do.
  Result<std::optional<std::string>> scoreSome(Connection& reader, const Uuid& session, SessionScore& score,
                                               StepWork work);
  DbWriter& writer_;
  ReaderPool& readers_;
  SharedLogins* const shared_ = nullptr;  ///< null: this server is alone
  const std::shared_ptr<ExportLedger> exports_ =
      std::make_shared<ExportLedger>();  ///< the writer's items have it
  const std::unique_ptr<CodeTries> codes_;
  std::atomic<bool> cancelled_{false};
  std::mutex backup_mutex_;  ///< one backup at a time
  std::atomic<bool> backup_running_ = false;
  std::mutex retention_mutex_;                ///< guards the text below; held only briefly
  std::optional<RunUnderWay> retention_run_;  ///< the current one; one at a time
  std::mutex faults_mutex_;
  std::map<Uuid, std::string>
      score_faults_;  ///< of sessions closed by this process; guarded by faults_mutex_
  /// Why samplesOf() refused sessions that somebody had scored anew; guarded by faults_mutex_.
  std::map<Uuid, Error> unreadable_;
  void addSoon(SoonNoted::Line line);
  const std::shared_ptr<SoonNoted> soon_noted_ = std::make_shared<SoonNoted>();
  ReferencePaths reference_paths_;
  RunningHashes running_hashes_;
  std::mutex rescore_mutex_;  ///< one run at a time
  std::unique_ptr<Duties> duties_ = std::make_unique<Duties>();
  std::atomic<bool> stop_retention_ = false;
  RetentionPace retention_pace_;
  BlockDevices disks_;
  std::optional<BackupKey> backup_key_;
};

}  // namespace needlelab
