/// Runs of retention (retention.h): requested, daily, and the removal of an erased person's chunks. One at a
/// time, here and over all servers of one database.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "db/audit/audit.h"
#include "db/service/records/retention.h"
#include "db/sessions/db_writer.h"
#include "db/store/store_address.h"

namespace needlelab {

class Backups;
class SessionScoring;

struct RunUnderWay {
  Doer by_whom;
  std::int64_t begun_unix_ns = 0;
};

/// Thread: any but the writer's. The arguments must outlive it.
class RetentionRuns {
 public:
  /// `scoring`: settles a recording before it is thinned or deleted, and forgets it. Runs wait for `backups`.
  RetentionRuns(DbWriter& writer, ReaderPool& readers, SessionScoring& scoring, const Backups& backups,
                const LongWork& long_work)
      : writer_(writer), readers_(readers), scoring_(scoring), backups_(backups), long_work_(long_work) {}

  /// One retention run (retention.h): minutes to hours. Fails immediately with kUnavailable while another run
  /// is in progress, here or at another server; if it is here, the message gives its start and user. A dry
  /// run only reads and never waits.
  Result<pb::RetentionReport> run(const Doer& by_whom, bool dry_run);
  /// The server's daily run, under the name "retention"; nothing: another server does it. Also kUnavailable
  /// if the last run, or the latest known time (seen_time.h), was more than 31 days ago: a clock that has
  /// jumped must not delete anything. A user who starts a run confirms the clock.
  Result<std::optional<pb::RetentionReport>> daily();
  /// run() on a person's request, which confirms the clock unless the run is dry.
  Result<pb::RetentionReport> runOnRequest(const Doer& by_whom, bool dry_run);
  /// Removes some of an erasure's chunks. Once `so_far` has no more: returns a sentence about remaining
  /// chunks and the reason; empty: none remain.
  std::string removeErased(const RetentionPace& pace, std::size_t max_pieces, LeftoversSoFar& so_far);

 private:
  [[nodiscard]] RetentionTools tools();

  DbWriter& writer_;
  ReaderPool& readers_;
  SessionScoring& scoring_;
  const Backups& backups_;
  const LongWork& long_work_;
  std::mutex mutex_;                // guards the next member; held only briefly
  std::optional<RunUnderWay> run_;  // the current one; one at a time
};

}  // namespace needlelab
