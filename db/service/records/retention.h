/// One retention run: thins and deletes due recordings in small pieces through the writer, so that it does
/// not slow down commits of stations' chunks.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/audit/audit.h"
#include "db/erasure/retention_store.h"
#include "db/service/context/long_work.h"
#include "db/sessions/db_writer.h"
#include "db/store/store_address.h"

namespace needlelab {

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
  /// Free bytes on the database's disk for this user; nothing if unknown. Null: space is not checked.
  std::function<std::optional<std::uint64_t>()> room{};
};

/// Steps for one recording (common/gesture/FORMAT.md, db/README.md): read all of the original, its CRCs and
/// its hash; write the thinned recording beside it; read that back from the database; switch over in one
/// transaction, including the audit line; remove the original. A crash at any instant leaves the original or
/// the thinned recording complete, and the next run removes the remains. Deletions come first, because they
/// free space. Skips recordings that the disk has no space for, and damaged ones. Errors: the database
/// failed; a problem of one session only appears in the report. Thread: any but the writer's; one run at a
/// time.
Result<pb::RetentionReport> runRetention(const RetentionTools& tools, const Doer& by_whom,
                                         std::int64_t now_unix_ns, bool dry_run);

/// Progress in removing the remaining rows of recordings that were replaced or deleted earlier.
struct LeftoversSoFar {
  std::map<Uuid, std::string> damaged;  ///< sessions whose rows stay, and what is wrong with each
  bool more = true;                     ///< false: all other rows are gone
};

/// Removes at most `max_pieces` pieces. A piece is `pace.rows` rows, from as many sessions as needed; each
/// session counts as at least one row. Ends early, with `more`, if stopped. Errors: the database's.
Status removeSomeLeftovers(const RetentionTools& tools, std::size_t max_pieces, LeftoversSoFar& so_far);

}  // namespace needlelab
