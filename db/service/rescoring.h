/// Scores stored sessions again after the definitions of measures have changed: in the background, as fast as
/// stations leave room.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "db/service/retention.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The tools of a run; all must outlive it.
struct RescoreTools {
  DbWriter& writer;
  ReaderPool& readers;
  /// The measures of a session by the definitions of now, as rows of JSON; empty: nothing to measure.
  std::function<Result<std::string>(Connection&, const Uuid&)> score;
  std::function<bool()> hold;     ///< as RetentionTools::hold
  const std::atomic<bool>& stop;  ///< set: the run ends after the session at hand; the next one goes on
  RetentionPace pace;
};

/// Gives each closed session whose newest score is of older definitions (and whose original recording is
/// there) one of the definitions of now; those that it has stay. What is done is committed session by
/// session: a run that was stopped, or whose server fell, is gone on with by the next. A session that cannot
/// be scored is named in the report and left as it is. `exercise_id`: of this exercise only; empty: of all.
/// One line in the audit log for a run that did something. Errors: the database failed. Thread: any but the
/// writer's; one run at a time.
Result<pb::RescoreReport> runRescoring(const RescoreTools& tools, const std::string& exercise_id,
                                       const std::string& by_whom, bool dry_run);

}  // namespace needlelab
