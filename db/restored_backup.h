/// A backup that another program made, restored into a database of its own: what of the lab's recordings it
/// proves to be in that backup. So are backups on PostgreSQL verified, whose own tools make them.
#pragma once

#include <cstdint>

#include "common/base/result.h"
#include "db/backup.h"
#include "db/connection.h"

namespace needlelab {

struct RestoredBackup {
  /// `bytes` is 0. `covered` has the sessions with a new watermark, by the rules of backupTo(): of a session
  /// that is open in `restored`, all chunks but the last; none from the first that cannot be decoded on.
  BackupResult result;
  std::int64_t made_unix_ns = 0;  ///< the latest time that the backup knows; 0: none
};

/// Checks the whole of `restored` (checkDatabase), then compares each session that would get a new watermark
/// with `live`: its chunks by their numbers and CRCs. Sessions that `live` does not have (erased since), or
/// not as they came, cover nothing. Only reads both. Errors: kInvalidInput (`restored` is the lab's own
/// database, one of its standbys, or another lab's), kVersion (not the newest schema), kCorrupt (it fails its
/// check, or a chunk differs; the message names the first), kUnavailable (`cancelled` became true), kFailed.
/// Takes a time proportional to the size of `restored`. Thread: as both connections, which must not be in a
/// transaction; `cancelled` may be null.
Result<RestoredBackup> compareRestored(Connection& live, Connection& restored,
                                       const std::atomic<bool>* cancelled = nullptr);

/// Raises the watermark of the sessions in `covered` (the caller empties it for a backup whose chunks are not
/// Safe), and the time of the last verified backup, never to an earlier one. `now_unix_ns` stands for a time
/// that the backup does not have or that lies behind it. Writer's connection, in a transaction.
Status recordRestored(Connection& writer, const RestoredBackup& backup, std::int64_t now_unix_ns);

}  // namespace needlelab
