/// A backup put in the place of a database: complete or not at all, and what was there is kept.
#pragma once

#include <cstdint>
#include <filesystem>

#include "base/result.h"

namespace needlelab {

struct RestoreResult {
  std::filesystem::path
      kept;  ///< the database that was replaced, with its log beside it; empty: there was none
  std::uint64_t sessions = 0, chunks = 0;  ///< in the restored one, all of them checked
  int schema = 0;  ///< of the backup; an older one was migrated
};

/// Copies `from` beside DIR's database, checks *the copy* (structure, every chunk, every hash), and then,
/// under the folder's lock, keeps the old database as needlelab.db.replaced-TIME (with its -wal) and puts the
/// copy in its place, without a -wal or -shm. A crash at any instant leaves the old database or, after the
/// decision was written to DIR/restore.pending, is completed by the next start of anything on DIR. `from` is
/// only read. Errors: kUnavailable (a server runs on DIR), kInvalidInput (no such file, or it is DIR's own
/// database), kVersion (newer schema), kCorrupt (it fails its check; nothing was changed), kFailed.
Result<RestoreResult> restoreFrom(const std::filesystem::path& folder, const std::filesystem::path& from,
                                  std::int64_t now_unix_ns);

/// Completes what restoreFrom decided before it was cut off. Under the folder's lock, before the database is
/// opened.
Status finishRestore(const std::filesystem::path& folder);

}  // namespace needlelab
