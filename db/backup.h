/// Online backup to another file, verified from the copy.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/result.h"
#include "base/uuid.h"
#include "db/connection.h"

namespace needlelab {

/// What the verified copy holds: the new watermark "Safe" (DESIGN §8).
struct BackupResult {
  std::uint64_t bytes = 0;            ///< of the file
  std::uint64_t chunks_verified = 0;  ///< read back from the copy, CRC and hashes checked
  struct Covered {
    Uuid session;
    std::uint64_t chunks;
  };
  std::vector<Covered> covered;  ///< sessions whose watermark rises
};

/// Copies the database as it is now (writers go on meanwhile) into `target`.partial, checks *the copy*
/// (integrity, every chunk, every hash), syncs it and renames it to `target` (0600). The source is only read.
/// Errors: kAlreadyExists (`target` is there: never overwritten), kInvalidInput (no such folder), kCorrupt
/// (the copy fails its check; it is deleted), kFailed. Blocks as long as the database is large.
Result<BackupResult> backupTo(Connection& reader, const std::filesystem::path& target);

/// Notes the watermark. Writer's connection, in a transaction.
Status recordBackup(Connection& writer, const BackupResult& result, const std::filesystem::path& target,
                    std::int64_t now_unix_ns);

}  // namespace needlelab
