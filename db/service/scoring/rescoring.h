/// Scores stored sessions again in the background, after the measures' definitions have changed; yields to
/// stations.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/audit/audit.h"
#include "db/service/context/long_work.h"
#include "db/sessions/db_writer.h"
#include "db/store/store_address.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

class Backups;
class SessionScoring;

/// The tools of a run; all must outlive it.
struct RescoreTools {
  DbWriter& writer;
  ReaderPool& readers;
  /// Returns a session's measures under the current definitions, as JSON rows; empty: nothing to measure.
  std::function<Result<std::string>(Connection&, const Uuid&)> score;
  std::function<bool()> hold;     ///< as in RetentionTools
  const std::atomic<bool>& stop;  ///< set: the run ends after the current session; the next run continues
  RetentionPace pace;
};

/// Scores each closed session that has its original recording and only older scores, by the current
/// definitions; keeps the older scores. Commits session by session: the next run continues where a stopped or
/// crashed one ended. The report names each session that cannot be scored; it stays unchanged. `exercise_id`:
/// only this exercise; empty: all. A run that changed something adds one audit line. Errors: the database
/// failed. Thread: any but the writer's; one run at a time.
Result<pb::RescoreReport> runRescoring(const RescoreTools& tools, const std::string& exercise_id,
                                       const Doer& by_whom, bool dry_run);

/// Rescoring runs, one at a time, here and over all servers of one database. Thread: any but the writer's.
/// The arguments must outlive it.
class RescoringRuns {
 public:
  /// Runs wait for `backups`.
  RescoringRuns(DbWriter& writer, ReaderPool& readers, SessionScoring& scoring, const Backups& backups,
                const LongWork& long_work)
      : writer_(writer), readers_(readers), scoring_(scoring), backups_(backups), long_work_(long_work) {}

  /// As runRescoring(): minutes to hours. kUnavailable: another run is in progress.
  Result<pb::RescoreReport> run(const Doer& by_whom, const pb::RescoreAll& call);

 private:
  DbWriter& writer_;
  ReaderPool& readers_;
  SessionScoring& scoring_;
  const Backups& backups_;
  const LongWork& long_work_;
  std::mutex mutex_;  // held by the run
};

}  // namespace needlelab
