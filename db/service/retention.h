/// One run of retention: thins and deletes due recordings in small pieces through the writer, so that it does
/// not slow the commits of stations' chunks.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/base/time_source.h"
#include "common/base/uuid.h"
#include "db/audit.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "db/retention_store.h"

namespace needlelab {

/// Limits of a run's use of the writer.
struct RetentionPace {
  std::uint32_t rows = 16;              ///< chunks removed in one piece
  std::size_t bytes = 96u << 10;        ///< of thinned chunks written in one piece; also read at once
  std::chrono::milliseconds pause{20};  ///< after each piece
  std::chrono::milliseconds look{20};   ///< between two looks at a busy writer
  std::uint64_t queue = 256;            ///< items in the writer's queue: with more, the run waits
  /// Free space to leave on the database's disk for stations, beyond a thinned recording's own size.
  /// Deletions need only an eighth of it, because they free space.
  std::uint64_t min_free_bytes = 64u << 20;
  TimeSource* time = &machineTime();  ///< of the pauses; must outlive the run

  void sleep(std::chrono::milliseconds duration) const {
    time->sleepForNs(std::chrono::nanoseconds(duration).count());
  }
};

/// The tools of a run; all must outlive it.
struct RetentionTools {
  DbWriter& writer;
  ReaderPool& readers;
  /// Computes a session's missing score and events while its samples still exist.
  std::function<Status(const Uuid&)> settle;
  /// True: another task needs the disk for a while (a backup, during which the log cannot be checkpointed).
  std::function<bool()> hold;
  const std::atomic<bool>& stop;  ///< set: the run ends after the current piece; the next run continues
  RetentionPace pace;
  /// Free bytes on the database's disk for this user; nothing when unknown. Null: space is not checked.
  std::function<std::optional<std::uint64_t>()> room{};
};

/// Order for one recording (common/gesture/FORMAT.md, db/README.md): read all of the original, its CRCs and
/// its hash; write the thinned recording beside it; read that back from the database; switch over in one
/// transaction, audit line included; remove the original. A crash at any instant leaves the original or the
/// thinned recording complete, and the next run removes the remains. Deletions come first, because they free
/// space. The run skips recordings that the disk has no space for, and damaged ones. Errors: the database
/// failed; a problem of one session only appears in the report. Thread: any but the writer's; one run at a
/// time.
Result<pb::RetentionReport> runRetention(const RetentionTools& tools, const Doer& by_whom,
                                         std::int64_t now_unix_ns, bool dry_run);

/// The removal of the remaining rows of recordings that were replaced or deleted before, between its steps.
struct LeftoversSoFar {
  std::map<Uuid, std::string> damaged;  ///< the sessions whose rows stay, and what is wrong with each
  bool more = true;                     ///< false: all other rows are gone
};

/// One step of it: at most `most_pieces` pieces. A piece has `pace.rows` rows of as many sessions as it
/// takes, each of which counts as a row at least. Ends early, with `more`, when it is stopped. Errors: the
/// database's.
Status removeSomeLeftovers(const RetentionTools& tools, std::size_t most_pieces, LeftoversSoFar& so_far);

}  // namespace needlelab
