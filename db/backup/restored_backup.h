/// Compares a backup made by other tools, restored into its own database, with the lab's recordings. This is
/// how PostgreSQL backups, which PostgreSQL's own tools make, are verified.
#pragma once

#include <cstdint>

#include "common/base/result.h"
#include "db/backup/backup.h"
#include "db/store/connection.h"

namespace needlelab {

struct RestoredBackup {
  /// `bytes` is 0. `covered` holds the sessions with a new watermark, by the rules of backupTo(): all chunks
  /// but the last for a session open in `restored`; none from the first undecodable chunk on.
  BackupResult result;
  std::int64_t made_unix_ns = 0;  ///< the latest time in the backup; 0: none
};

/// Checks all of `restored` (checkDatabase), then compares each session that would get a new watermark with
/// `live`: chunk numbers and CRCs. Sessions that `live` lacks (erased since), or no longer holds as received,
/// are not covered. Only reads both. Takes time proportional to the size of `restored`. Errors: kInvalidInput
/// (`restored` is the lab's own database, one of its standbys, or another lab's), kVersion (not the newest
/// schema), kCorrupt (it fails its check, or a chunk differs; the message names the first), kUnavailable
/// (`cancelled` became true), kFailed. Thread: as both connections, which must not be in a transaction;
/// `cancelled` may be null.
Result<RestoredBackup> compareRestored(Connection& live, Connection& restored,
                                       const std::atomic<bool>* cancelled = nullptr);

/// Raises the watermark of the sessions in `covered` (the caller empties it if the backup's chunks do not
/// count as Safe) and the time of the last verified backup, never to an earlier one. If the backup has no
/// time, or one in the future, `now_unix_ns` is used. Needs the writer's connection, in a transaction.
Status recordRestored(Connection& writer, const RestoredBackup& backup, std::int64_t now_unix_ns);

}  // namespace needlelab
