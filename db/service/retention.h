/// One run of retention: thins and deletes the recordings whose time has come, in small pieces through the
/// writer, so that what stations send is committed as fast as without it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "db/retention_store.h"

namespace needlelab {

/// How much of the writer a run may take.
struct RetentionPace {
  std::uint32_t rows = 16;              ///< chunks removed in one piece
  std::size_t bytes = 96u << 10;        ///< of thinned chunks written in one piece; also read at once
  std::chrono::milliseconds pause{20};  ///< after each piece
  std::uint64_t queue = 256;            ///< items waiting at the writer: with more, the run waits
  /// On the database's disk, beyond what a thinned recording takes: less is left to what stations send. With
  /// an eighth of it recordings are still deleted, which makes room.
  std::uint64_t min_free_bytes = 64u << 20;
};

/// The tools of a run; all must outlive it.
struct RetentionTools {
  DbWriter& writer;
  ReaderPool& readers;
  /// Works out score and events of a session where they are missing, while its samples are there.
  std::function<Status(const Uuid&)> settle;
  /// True: somebody else has the disk for a while (a backup, which keeps the log from being checkpointed).
  std::function<bool()> hold;
  const std::atomic<bool>& stop;  ///< set: the run ends after the piece at hand; the next one goes on
  RetentionPace pace;
  /// Bytes that are free on the database's disk for this user; nothing when it cannot be asked. Null: there
  /// is always room.
  std::function<std::optional<std::uint64_t>()> room{};
};

/// Order for one recording (common/gesture/FORMAT.md, db/README.md): read all of the original, its CRCs and
/// its hash; write the thinned recording beside it; read that back from the database; switch over in one
/// transaction, audit line included; remove the original. A crash at any instant leaves the original or the
/// thinned recording complete, and the next run removes what is left over. What is to be deleted goes first,
/// so that it makes room; what the disk has no room for is left alone. A damaged recording is left alone,
/// too. Errors: the database failed; what is wrong with one session only stands in the report. Thread: any
/// but the writer's; one run at a time.
Result<pb::RetentionReport> runRetention(const RetentionTools& tools, const std::string& by_whom,
                                         std::int64_t now_unix_ns, bool dry_run);

/// Only what is left over is removed: rows of recordings that were given up before, in the same pieces.
/// Damaged ones stay; the report names them as LEFT_ALONE.
Result<pb::RetentionReport> removeLeftovers(const RetentionTools& tools);

}  // namespace needlelab
