/// The backups in a folder: how they are named, and which are removed once there is a newer one.
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

/// Extension of plain backups.
inline constexpr std::string_view kPlainEnding = ".db";

/// File name of a backup made at this time: needlelab-20260131T020000Z.db, or with kEncryptedEnding.
std::string backupName(std::int64_t now_unix_ns, std::string_view ending = kPlainEnding);

/// Files in this folder with backup names, plain and encrypted, sorted by the time in their names; links are
/// excluded. Anyone with write access to the folder may have created them. Errors: kFailed.
Result<std::vector<std::filesystem::path>> backupsIn(const std::filesystem::path& folder);

/// Unfinished copies with backup names, and SQLite's files beside them, last written before `before`; sorted.
/// A power cut or a kill leaves them behind. Links are excluded.
std::vector<std::filesystem::path> partialsIn(const std::filesystem::path& folder,
                                              std::filesystem::file_time_type before);

/// The user and the call that remove files; for tests.
struct BackupRemover {
  std::optional<uid_t> own;  ///< nothing: the new backup's owner by its file system (NFS may map users)
  int (*unlink)(const char* path) = ::unlink;
};

/// Older backups in the same folder as a new one.
struct OldBackups {
  std::vector<std::filesystem::path> removed;
  /// Named with a later time than the new one; neither removed nor counted.
  std::vector<std::filesystem::path> later;
  /// Named as backups or unfinished ones, but owned by another user than the new one or not a backup by their
  /// first bytes; neither removed nor counted.
  std::vector<std::filesystem::path> others;
  std::vector<std::filesystem::path> failed;  ///< could not be removed
  std::string why;                            ///< for the first of `failed`, with its path

  /// Summary of what was left behind, for the audit log: counts and one name of each kind. Empty: nothing.
  [[nodiscard]] std::string remainingText() const;
};

/// Removes the backups beside `target`, plain and encrypted, except the newest `keep` by the time in their
/// names (backupName). Only regular files that `target`'s owner owns and that start like a backup are counted
/// or removed, so foreign files displace no backup. `target` must exist, counts as one of them and is never
/// removed, regardless of the other names. Also removes partialsIn() files of the same owner that were last
/// written more than a day before `target`. A file that cannot be removed does not stop the others: see
/// `failed`. Errors: kFailed (`target` is missing, or the folder cannot be listed).
Result<OldBackups> removeOldBackups(const std::filesystem::path& target, std::size_t keep,
                                    const BackupRemover& by = {});

}  // namespace needlelab
