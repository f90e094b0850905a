/// Closes sessions (hash, score, events), scores them again, and caches what it needs to know about
/// recordings.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/scoring/motion/recorded_samples.h"
#include "db/service/context/principal.h"
#include "db/service/scoring/reference_paths.h"
#include "db/service/scoring/running_hashes.h"
#include "db/service/scoring/session_score.h"
#include "db/sessions/db_writer.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"
#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"

namespace needlelab {

struct RequestUnderWay;

/// Work of one scoring step, as StepWork counts: about 50 ms, for which the next request waits. Smaller: more
/// reads of the session's row; greater: longer waits.
inline constexpr std::uint64_t kScoredAtOnce = 250'000;

/// The outcome of a station's request to close a session.
struct CloseOutcome {
  Closed closed;
  std::string score_json;   ///< once closed: the stored measures; empty if there is nothing to measure, or an
                            ///< exam's results are held back (held_results.h)
  std::string score_fault;  ///< why scoring failed; the session is closed nevertheless
  std::uint64_t event_bytes = 0;  ///< of syringe events stored by this close
};

/// A session up to this length is scored in one step: about 0.1 s of a thread, and 22 MB at 1 kHz. A longer
/// one takes up to about 3 s, in steps of kScoredAtOnce, between which it holds up to 110 MB (SessionScore).
/// Smaller: more closes share fewer threads; greater: a short session's close waits for longer ones.
inline constexpr std::uint64_t kShortScoreSamples = 100'000;

/// A station's request to close a session, between the steps of its work.
struct CloseUnderWay {
  pb::CloseSession request;
  std::string station;             ///< empty: any
  std::uint32_t looked_again = 0;  ///< number of repeats because chunks arrived meanwhile
  /// Closed, but not scored yet: not all required distances are computed.
  std::optional<CloseOutcome> unscored{};
  std::shared_ptr<SessionScore> score{};  ///< as far as it is made
  /// Only the score of a session of more than kShortScoreSamples remains.
  bool is_long = false;
  /// The log-in that sent the request, like ArrivedChunk::claim; nothing is stored once the station has
  /// logged in again.
  std::shared_ptr<const StationClaim> claim{};
};

/// Thread: every function is thread-safe and blocks (closing: in proportion to the data). Writer and readers
/// must outlive it.
class SessionScoring {
 public:
  SessionScoring(DbWriter& writer, ReaderPool& readers) : writer_(writer), readers_(readers) {}

  /// Performs one step of a close: hashes more of the stored chunks (RunningHashes) on a reader; closes the
  /// session on the writer; computes more of its distances to references (ReferencePaths) and then more of
  /// its score (SessionScore); finally stores score and events. Nothing: call again after others had their
  /// turn; also returned before a long score, so that it can be made where no one waits for it. A caller that
  /// stops may close the session again later: the close resumes, but the score is made again. Returns the
  /// outcome after the commit. Chunks hashed once are not read again for another close, however the first one
  /// ended. A session that could not be scored gets the same answer when it is closed again, without being
  /// read. kUnavailable: chunks kept arriving meanwhile; kDeposed: see CloseUnderWay::claim.
  Result<std::optional<CloseOutcome>> closeStep(CloseUnderWay& close);
  /// closeStep() until it is done.
  Result<CloseOutcome> closeSession(const pb::CloseSession& request, const std::string& station);
  /// Bytes of chunks that closes have read for hashes since the start; measures their cost.
  [[nodiscard]] std::uint64_t bytesHashed() const { return running_hashes_.bytesHashed(); }

  /// Scores a session's gesture (common/scoring/README.md) from its stored chunks and its profile; returns
  /// JSON rows. kInvalidInput and kCorrupt: as samplesOf(); remembered until recordings are removed.
  Result<std::string> scoreSession(Connection& reader, const Uuid& session);

  /// Scores a closed session again with this program's definitions and keeps the result beside the first
  /// score. In steps.
  Result<pb::Reply> rescore(const Principal& who, const pb::RescoreSession& call, RequestUnderWay& under_way);
  /// Makes and stores a missing score or events before a recording is thinned or deleted. Returns an error
  /// for a temporary fault (memory, an exercise that may be imported again …): the original must stay until
  /// it passes.
  Status settleRecording(const Uuid& session);
  /// Forgets cached facts about recordings, because some were removed, perhaps by another server.
  void forgetRecordings();

  [[nodiscard]] ReferencePaths& referencePaths() { return reference_paths_; }
  /// Distances between paths that comparisons with references have computed since the start.
  [[nodiscard]] std::uint64_t distancesComputed() const { return reference_paths_.distancesComputed(); }
  /// Cost limit of one comparison with a reference (reference_paths.h). Call before the first one.
  void setMostComparedCells(std::uint64_t cells) { reference_paths_.setMostCells(cells); }

 private:
  struct Settled {
    std::string score_json;      ///< empty if there is nothing to measure
    std::optional<Error> fault;  ///< why scoring failed
    /// The fault is permanent: too long, motion beyond its limits, or an invalid profile. The first two get a
    /// remark, "cannot be scored: …", and are not read again.
    bool final = false;
    std::uint64_t event_bytes = 0;  ///< as in CloseOutcome
    bool is_pending = false;        ///< nothing is stored yet; more work is needed
  };
  /// The steps of a close once the session is closed.
  Result<std::optional<CloseOutcome>> scoreStep(Connection& reader, const Uuid& session,
                                                CloseUnderWay& close);
  /// Makes more of a closed session's score and events, and stores them at the end. Errors: the database's.
  /// `claim`: as CloseUnderWay::claim; null: not checked.
  Result<Settled> settle(Connection& reader, const Uuid& session, SessionScore& score, StepWork work,
                         const StationClaim* claim = nullptr);
  Result<Settled> settleOrThrow(Connection& reader, const Uuid& session, SessionScore& score, StepWork work,
                                const StationClaim* claim);
  /// Makes more of a score, as scoreSession(). Nothing: more work is needed.
  Result<std::optional<std::string>> scoreSome(Connection& reader, const Uuid& session, SessionScore& score,
                                               StepWork work);

  DbWriter& writer_;
  ReaderPool& readers_;
  ReferencePaths reference_paths_;
  RunningHashes running_hashes_;
  std::mutex faults_mutex_;
  std::map<Uuid, std::string>
      score_faults_;  ///< of sessions closed by this process; guarded by faults_mutex_
  /// samplesOf()'s errors for sessions that someone scored again; guarded by faults_mutex_.
  std::map<Uuid, Error> unreadable_;
};

}  // namespace needlelab
