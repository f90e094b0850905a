/// Opens database files that others may have written: backups, files next to them, replaced databases.
/// Compares a backup made by other tools, restored into its own database, with the lab's recordings.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/backup/backup.h"
#include "db/store/connection.h"

namespace needlelab {

/// Time limit for reading one foreign file. Smaller: names in large backups are not all searched; greater: a
/// hostile file blocks its reader for longer.
inline constexpr std::chrono::seconds kMaxTimeOfForeign{10};

/// Limits on reading a foreign file before its schema is known to be needlelab's: SQLite uses up to about 80
/// bytes of memory per byte of a definition. A backup's own schema needs a tenth of this.
struct ForeignSchemaBounds {
  static constexpr int kMaxTextBytes = 64 << 10;
  static constexpr int kMaxColumns = 100;
  static constexpr std::uint64_t kMostBytes = 512 << 10;  ///< over all rows
  static constexpr std::uint64_t kMostRows = 2000;        ///< each keeps at worst a 64 KiB page in memory
};

/// Limit for one text or BLOB outside the schema; a longer one is an error. What needlelab stores arrived in
/// messages of at most 1 MiB.
inline constexpr int kMaxForeignTextBytes = 4 << 20;

/// Errors: kNotFound; kInvalidInput (a link, or not a regular file); kUnavailable (a non-empty log or journal
/// lies beside it).
Status requireUnused(const std::filesystem::path& path);

/// Opens an untrusted file. Reads that file alone: applies no log or journal beside it (SQLite would delete
/// any file that a journal names), writes nothing, does not follow a link as the last path component, and
/// does not block on a pipe. The schema is needlelab's (schemaFaults()) and stays so: the connection is in a
/// transaction until it is closed. Reads later than `max_time` from now are aborted. Errors: those of
/// requireUnused(); kInvalidInput (later: a text is too long); kUnavailable (time is up); kCorrupt (not a
/// needlelab database, or its schema was changed); kVersion (newer than this program); kFailed (also when
/// `cancelled`, which may be null, became true). `cancelled` and `time` must outlive the connection. Thread:
/// as the connection.
Result<Connection> openForeign(const std::filesystem::path& path,
                               const std::atomic<bool>* cancelled = nullptr,
                               std::chrono::nanoseconds max_time = kMaxTimeOfForeign,
                               TimeSource& time = machineTime());

// --- a backup made by other tools: how PostgreSQL's backups, which its own tools make, are verified

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
