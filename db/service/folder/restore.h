/// Replaces a database with a backup, plain or encrypted: completely or not at all. Keeps the old database.
#pragma once

#include <cstdint>
#include <filesystem>

#include "common/base/result.h"

namespace needlelab {

struct RestoreResult {
  /// The replaced database, with its log beside it; empty: none existed.
  std::filesystem::path kept;
  std::uint64_t sessions = 0, chunks = 0;  ///< in the restored database; all checked
};

/// Copies `from` (read-only) beside DIR's database and checks *the copy* (structure, every chunk, every
/// hash). Then, under the folder's lock, keeps the old database as needlelab.db.replaced-TIME (with its -wal)
/// and puts the copy in its place. A crash at any instant leaves the old database; once the decision is in
/// DIR/restore.pending, the next start of any program on DIR completes the restore. `key_file`: the key of an
/// encrypted backup; empty: `from` is plain. Errors: kUnavailable (a server runs on DIR), kInvalidInput (no
/// such file, or it is DIR's own database; the key is missing, wrong, or given for a plain backup), kVersion
/// (newer schema or format), kCorrupt (the backup or its copy fails its check, or the list of erasures beside
/// it cannot be read or is too long; nothing was changed), kNoRoom (for the copy), kFailed.
Result<RestoreResult> restoreFrom(const std::filesystem::path& folder, const std::filesystem::path& from,
                                  std::int64_t now_unix_ns, const std::filesystem::path& key_file = {});

}  // namespace needlelab
