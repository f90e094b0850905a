/// Online backup to another file, plain or encrypted, verified from the copy.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "db/encrypted_backup.h"

namespace needlelab {

/// The contents of the verified copy: the new watermark "Safe".
struct BackupResult {
  std::uint64_t bytes = 0;               ///< of the file
  std::uint64_t chunks_verified = 0;     ///< read back from the copy, decoded, hashes checked
  std::uint64_t undecodable_chunks = 0;  ///< in the copy as they came, but never Safe
  struct Covered {
    Uuid session;
    std::uint64_t chunks;
  };
  /// Sessions with a new watermark. For a session that is open in the copy, all chunks but the last, because
  /// the copy does not cover its end.
  std::vector<Covered> covered;
};

/// The log beside the database above which a backup gives up: it holds one view of the database, and the log
/// can be emptied only afterwards.
inline constexpr std::uint64_t kMostLogBytesOfBackup = kMostLogBytesOfReaders;

/// Room that a backup leaves on the database's disk while its copy lies there. Smaller:
/// lessons that run may find the disk full (server/live/disk_room.h); greater: backups end earlier for want
/// of room.
inline constexpr std::uint64_t kRoomBesidePlainCopy = std::uint64_t{512} << 20;

/// The copy that a backup is made of, beside the database: where the data is plain anyway, and where nobody
/// else writes. SQLite never opens a file in the backup's folder: whoever may write there could put a journal
/// beside it, which names other files.
std::filesystem::path plainCopyBeside(const std::filesystem::path& database);

/// link(2), or for tests a replacement that fails as between two disks.
using LinkCopy = int (*)(const char* from, const char* to);

/// Copies the database's present state to plainCopyBeside() while writers continue, checks *the copy*
/// (integrity, every chunk, every hash), and puts it to `target`.partial: links it there on the same disk,
/// else writes its bytes and reads them back from the disk. Syncs this and renames it to `target` (0600); the
/// copy is removed in every case. Only reads the source. One at a time for a database. Errors: kAlreadyExists
/// (`target` exists; it is never overwritten), kInvalidInput (the folder does not exist), kCorrupt (the copy
/// fails its check, or what was read back is not what was written; it is deleted), kUnavailable (`cancelled`
/// became true, or the log beside the source grew above `most_log_bytes` meanwhile), kNoRoom (the database's
/// disk has no room for the copy and `room_left` bytes), kFailed. Blocks for a time proportional to the
/// database's size. The copy and its check poll `cancelled` often; it may be null.
Result<BackupResult> backupTo(Connection& reader, const std::filesystem::path& target,
                              const std::atomic<bool>* cancelled = nullptr,
                              std::uint64_t most_log_bytes = kMostLogBytesOfBackup,
                              std::uint64_t room_left = kRoomBesidePlainCopy, LinkCopy link = nullptr);

/// The same, encrypted: encrypts the checked copy to `target`.partial, reads this back from the disk through
/// the decryptor and compares hashes. Never puts anything plain into the backup's folder.
Result<BackupResult> encryptedBackupTo(Connection& reader, const std::filesystem::path& target,
                                       const BackupKey& key, const std::atomic<bool>* cancelled = nullptr,
                                       std::uint64_t most_log_bytes = kMostLogBytesOfBackup,
                                       std::uint64_t room_left = kRoomBesidePlainCopy);

/// Stores the backup's time and place, and raises the watermark of the sessions in `covered` (the caller
/// empties it for a backup whose chunks are not Safe). Writer's connection, in a transaction.
Status recordBackup(Connection& writer, const BackupResult& result, const std::filesystem::path& target,
                    std::int64_t now_unix_ns);

}  // namespace needlelab
