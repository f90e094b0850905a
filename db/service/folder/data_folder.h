/// A data folder before a program uses it: creating it, locking it for one process, checking what blocks its
/// files, and handling what a killed program left or had decided. Replaces its database with a backup, plain
/// or encrypted: completely or not at all, and keeps the old database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// An exclusive lock on DIR/lock (flock), held until destruction. The kernel releases it when the process
/// dies.
class FolderLock {
 public:
  /// kUnavailable: "a server is running on DIR: use --server", with the holder's name and process id.
  static Result<FolderLock> take(const std::filesystem::path& folder, const std::string& holder);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&&) = delete;
  ~FolderLock();

 private:
  explicit FolderLock(int fd) : fd_(fd) {}
  int fd_;
};

/// In the data folder: the copy that a restore makes and checks, and the file with its decision and the old
/// database's new name.
inline constexpr const char* kRestoringCopy = "needlelab.db.restoring";
inline constexpr const char* kRestorePending = "restore.pending";

/// In the data folder: a copy of a PostgreSQL database, until it is complete.
inline constexpr const char* kCopyingDatabase = "needlelab.db.copying";
/// Prefix of the names of replaced DIR/store files.
inline constexpr const char* kReplacedStoreFile = "store.replaced-";

/// Creates DIR; if it is new, only its owner has access.
Status makeFolder(const std::filesystem::path& given);

/// kInvalidInput if something other than a file is in the place of one of this program's files: opening a
/// pipe would block forever. Connection::open checks the database and SQLite's files.
Status checkOwnFiles(const std::filesystem::path& folder);

/// Removes what a killed program left in the folder: the copy of an undecided restore, the plain copy of an
/// encrypted backup, temporary files beside this program's own; here and in its folder `backups`, unfinished
/// copies of backups (partialsIn). Only files with exactly these names, no links; what cannot be removed
/// stays. Returns what was removed, sorted. Call under the folder's lock, after finishRestore().
std::vector<std::filesystem::path> removeFolderLeftovers(const std::filesystem::path& folder);

/// Whether the programs keep a file of this name, or its temporary file, there: in the data folder `folder`
/// the lock, keys, the list of erasures, heads of the audit log, the acknowledgement mark and SQLite's files
/// beside the database; in its `tls` keys and certificates. Only SQLite's contain names of people. Databases
/// and their copies are excluded. `path` begins with `folder` as written.
bool isOwnFile(const std::filesystem::path& folder, const std::filesystem::path& path);

/// Completes a restore that was interrupted after its decision. Call under the folder's lock, before the
/// database is opened.
Status finishRestore(const std::filesystem::path& folder);

/// Completes a move that was decided before a crash: DIR/store and the databases get their names. Call under
/// the folder's lock, before the database is opened. Errors: kInvalidInput (DIR/store), kFailed.
Status finishStoreSwitch(const std::filesystem::path& folder);

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
