/// Online backup to another file, verified from the copy.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"

namespace needlelab {

/// The contents of the verified copy: the new watermark "Safe".
struct BackupResult {
  std::uint64_t bytes = 0;            ///< of the file
  std::uint64_t chunks_verified = 0;  ///< read back from the copy, CRC and hashes checked
  struct Covered {
    Uuid session;
    std::uint64_t chunks;
  };
  /// Sessions whose watermark rises; of one that is open in the copy all chunks but the last, because its end
  /// is not covered.
  std::vector<Covered> covered;
};

/// Copies the database as it is now (writers go on meanwhile) into `target`.partial, checks *the copy*
/// (integrity, every chunk, every hash), syncs it and renames it to `target` (0600). The source is only read.
/// Errors: kAlreadyExists (`target` is there: never overwritten), kInvalidInput (no such folder), kCorrupt
/// (the copy fails its check; it is deleted), kUnavailable (`cancelled` became true), kFailed. Blocks as long
/// as the database is large. `cancelled`: asked often, by the copy and by its check; may be null.
Result<BackupResult> backupTo(Connection& reader, const std::filesystem::path& target,
                              const std::atomic<bool>* cancelled = nullptr);

/// The name of a backup made at this time: needlelab-20260131T020000Z.db.
std::string backupName(std::int64_t now_unix_ns);

/// The backups beside a new one.
struct OldBackups {
  std::vector<std::filesystem::path> removed;
  std::vector<std::filesystem::path> later;  ///< named by a time after the new one's: left alone, not counted
};

/// Of the files beside `target` that are named as backupName does, removes all but the newest `keep`, of
/// which `target`, just made, is one: it is never removed, whatever the others' names say. Others are not
/// touched. Errors: kFailed.
Result<OldBackups> removeOldBackups(const std::filesystem::path& target, std::size_t keep);

/// Notes the watermark. Writer's connection, in a transaction.
Status recordBackup(Connection& writer, const BackupResult& result, const std::filesystem::path& target,
                    std::int64_t now_unix_ns);

}  // namespace needlelab
