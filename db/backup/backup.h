/// Online backups to a file, plain or encrypted, verified from the copy.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/backup/encrypted_backup.h"
#include "db/store/connection.h"

namespace needlelab {

/// Contents of the verified copy: the new "Safe" watermark.
struct BackupResult {
  std::uint64_t bytes = 0;               ///< the file's size
  std::uint64_t chunks_verified = 0;     ///< read back from the copy, decoded, hashes checked
  std::uint64_t undecodable_chunks = 0;  ///< copied as received, but never Safe
  struct Covered {
    Uuid session;
    std::uint64_t chunks;
  };
  /// Sessions with a new watermark. A session still open in the copy counts without its last chunk, because
  /// the copy does not contain its end.
  std::vector<Covered> covered;
};

/// A backup gives up if the log beside the database grows above this: the backup's read view keeps the log
/// from being emptied.
inline constexpr std::uint64_t kMaxLogBytesOfBackup = kMaxLogBytesOfReaders;

/// Free space that a backup leaves on the database's disk next to its copy. Smaller: running lessons may find
/// the disk full (server/live/limits/disk_room.h). Greater: backups fail sooner for lack of space.
inline constexpr std::uint64_t kPlainCopyReserveBytes = std::uint64_t{512} << 20;

/// The copy from which a backup is made, next to the database: the data is stored in plain text there anyway,
/// and only the server writes there. SQLite never opens a file in the backup's folder: anyone who can write
/// there could add a journal that names other files.
std::filesystem::path plainCopyPath(const std::filesystem::path& database);

/// link(2), or in tests a replacement that fails as if across two disks.
using LinkCopy = int (*)(const char* from, const char* to);

/// Copies the database's current state to plainCopyPath() while writers continue, and checks *the copy*
/// (integrity, every chunk, every hash). Then hard-links it to `target`.partial if that is on the same disk;
/// otherwise writes the bytes there and reads them back from the disk. Syncs this file and renames it to
/// `target` (0600). The copy is always removed. Only reads the source. One at a time per database. Blocks for
/// a time proportional to the database's size; polls `cancelled` (may be null) often. Errors: kAlreadyExists
/// (`target` exists; it is never overwritten), kInvalidInput (the folder does not exist), kCorrupt (the copy
/// fails its check, or the bytes read back differ; it is deleted), kUnavailable (`cancelled` became true, or
/// the log beside the source grew above `max_log_bytes`), kNoRoom (the database's disk cannot hold the copy
/// plus `room_left` bytes), kFailed.
Result<BackupResult> backupTo(Connection& reader, const std::filesystem::path& target,
                              const std::atomic<bool>* cancelled = nullptr,
                              std::uint64_t max_log_bytes = kMaxLogBytesOfBackup,
                              std::uint64_t room_left = kPlainCopyReserveBytes, LinkCopy link = nullptr);

/// Like backupTo(), but encrypts the checked copy to `target`.partial, reads it back from the disk through
/// the decryptor and compares hashes. Never writes plain data to the backup's folder.
Result<BackupResult> encryptedBackupTo(Connection& reader, const std::filesystem::path& target,
                                       const BackupKey& key, const std::atomic<bool>* cancelled = nullptr,
                                       std::uint64_t max_log_bytes = kMaxLogBytesOfBackup,
                                       std::uint64_t room_left = kPlainCopyReserveBytes);

/// Stores the backup's time and place, and raises the watermark of the sessions in `covered` (the caller
/// empties it if the backup's chunks do not count as Safe). Needs the writer's connection, in a transaction.
Status recordBackup(Connection& writer, const BackupResult& result, const std::filesystem::path& target,
                    std::int64_t now_unix_ns);

}  // namespace needlelab
