/// Scores stored sessions again after the measures' definitions have changed: in the background, yielding to
/// stations.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/audit.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "db/service/retention.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The tools of a run; all must outlive it.
struct RescoreTools {
  DbWriter& writer;
  ReaderPool& readers;
  /// Returns a session's measures by the current definitions, as JSON rows; empty: nothing to measure.
  std::function<Result<std::string>(Connection&, const Uuid&)> score;
  std::function<bool()> hold;     ///< as RetentionTools::hold
  const std::atomic<bool>& stop;  ///< set: the run ends after the current session; the next run continues
  RetentionPace pace;
};

/// Scores by the current definitions each closed session that has its original recording and only older
/// scores; keeps the older scores. Commits session by session: the next run continues where a stopped or
/// crashed one ended. The report names each session that cannot be scored; that session stays unchanged.
/// `exercise_id`: only this exercise; empty: all. A run that changed something adds one line to the audit
/// log. Errors: the database failed. Thread: any but the
/// writer's; one run at a time.
Result<pb::RescoreReport> runRescoring(const RescoreTools& tools, const std::string& exercise_id,
                                       const Doer& by_whom, bool dry_run);

}  // namespace needlelab
