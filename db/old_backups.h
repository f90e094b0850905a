/// The backups of a folder: how they are named, and which of them go when a newer one is there.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// The end of a plain backup's name.
inline constexpr std::string_view kPlainEnding = ".db";

/// The file name of a backup made at this time: needlelab-20260131T020000Z.db, or with kEncryptedEnding.
std::string backupName(std::int64_t now_unix_ns, std::string_view ending = kPlainEnding);

/// The files of this folder that are named so, plain and encrypted ones, by the time in their names. Links
/// are none. Whoever may write there can have made them. kFailed.
Result<std::vector<std::filesystem::path>> backupsIn(const std::filesystem::path& folder);

/// Unfinished copies of backups with such names, and what SQLite put beside them, that were last written
/// before `before`, sorted: what a power cut or a kill left in this folder. Links are none.
std::vector<std::filesystem::path> partialsIn(const std::filesystem::path& folder,
                                              std::filesystem::file_time_type before);

/// Who removes files and how: for tests.
struct BackupRemover {
  std::optional<uid_t> own;  ///< none: the new backup's owner, as its file system tells (NFS may map users)
  int (*unlink)(const char* path) = ::unlink;
};

/// Older backups in the same folder as a new one.
struct OldBackups {
  std::vector<std::filesystem::path> removed;
  /// Named with a later time than the new one: not removed, not counted.
  std::vector<std::filesystem::path> later;
  /// Named as backups or as unfinished ones, but another user's than the new one, or not a backup by their
  /// first bytes: not removed, not counted.
  std::vector<std::filesystem::path> others;
  std::vector<std::filesystem::path> failed;  ///< could not be removed
  std::string why;                            ///< for the first of `failed`, with its path

  /// What was left, for the audit log: numbers and one name of each kind. Empty: nothing was.
  [[nodiscard]] std::string leftText() const;
};

/// Removes the backups beside `target`, plain and encrypted ones, except the newest `keep`, by the time in
/// their names (backupName). Counts and removes only regular files of the owner of `target` that begin as a
/// backup does: what somebody else puts there costs no backup its place. `target`, which must exist, counts
/// as one of them and is never removed, whatever the other names say. Removes also what partialsIn() finds of
/// the same owner that was last written more than a day before `target`. What cannot be removed holds up no
/// other file: see `failed`. Errors: kFailed (`target` is not there, the folder cannot be listed).
Result<OldBackups> removeOldBackups(const std::filesystem::path& target, std::size_t keep,
                                    const BackupRemover& by = {});

}  // namespace needlelab
