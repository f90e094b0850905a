#include "db/backup/old_backups.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <chrono>

#include "common/base/files/files.h"
#include "db/backup/database_files.h"
#include "db/backup/encrypted_backup.h"
#include "db/store/schema.h"

namespace needlelab {

std::string backupName(std::int64_t now_unix_ns, std::string_view ending) {
  return "needlelab-" + timeForNames(now_unix_ns) + std::string(ending);
}

namespace {

constexpr std::string_view kNameShape = "needlelab-00000000T000000Z";

/// Accepts only this program's names; other files in the folder are not ours.
bool isBackupName(std::string_view name) {
  if (name.size() < kNameShape.size()) return false;
  for (std::size_t i = 0; i < kNameShape.size(); ++i) {
    const bool digit = name[i] >= '0' && name[i] <= '9';
    if (kNameShape[i] == '0' ? !digit : name[i] != kNameShape[i]) return false;
  }
  const std::string_view ending = name.substr(kNameShape.size());
  return ending == kPlainEnding || ending == kEncryptedEnding;
}

/// Whether it is the unfinished copy of a backup, or one of SQLite's files beside it.
bool isPartialName(std::string_view name) {
  const auto end = name.find(".partial");
  if (end == std::string_view::npos || !isBackupName(name.substr(0, end))) return false;
  const std::string_view behind = name.substr(end + std::string_view(".partial").size());
  return behind.empty() || behind == "-journal" || behind == "-wal" || behind == "-shm";
}

bool isFileOf(uid_t own, const std::filesystem::path& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode) && info.st_uid == own;
}

/// Whether the file starts like a needlelab database: SQLite's magic, and the application id at byte 68,
/// big-endian (https://sqlite.org/fileformat.html, 1.3).
bool isPlainBackup(const std::filesystem::path& path) {
  constexpr std::string_view kSqliteMagic("SQLite format 3\0", 16);
  constexpr std::size_t kIdAt = 68;
  std::array<char, kIdAt + 4> start{};
  const OpenFile in(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!in.isOpen() || ::pread(in.fd(), start.data(), start.size(), 0) != static_cast<ssize_t>(start.size()))
    return false;
  std::int64_t id = 0;
  for (std::size_t i = kIdAt; i < start.size(); ++i) id = id << 8 | static_cast<std::uint8_t>(start[i]);
  return std::string_view(start.data(), kSqliteMagic.size()) == kSqliteMagic && id == kApplicationId;
}

}  // namespace

std::vector<std::filesystem::path> partialsIn(const std::filesystem::path& folder,
                                              std::filesystem::file_time_type before) {
  std::vector<std::filesystem::path> left;
  std::error_code error, ignored;
  for (auto at = std::filesystem::directory_iterator(folder, error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    if (!isPartialName(at->path().filename().string()) ||
        !std::filesystem::is_regular_file(at->symlink_status(ignored)))
      continue;
    const auto written = at->last_write_time(ignored);
    if (!ignored && written < before) left.push_back(at->path());
  }
  std::sort(left.begin(), left.end());
  return left;
}

Result<std::vector<std::filesystem::path>> backupsIn(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> found;
  std::error_code error;
  for (auto at = std::filesystem::directory_iterator(folder, error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    std::error_code ignored;
    if (isBackupName(at->path().filename().string()) &&
        std::filesystem::is_regular_file(at->symlink_status(ignored)))
      found.push_back(at->path());
  }
  if (error)
    return Error{ErrorCode::kFailed, folder.string() + ": cannot list the backups: " + error.message()};
  // names sort by time, regardless of extension
  std::sort(found.begin(), found.end());
  return found;
}

Result<OldBackups> removeOldBackups(const std::filesystem::path& target, std::size_t keep,
                                    const BackupRemover& by) {
  const std::string newest = target.filename().string();
  struct stat made {};
  if (::lstat(target.c_str(), &made) != 0) return systemError(target, "look at the new backup");
  const uid_t own = by.own.value_or(made.st_uid);
  std::vector<std::filesystem::path> older;
  OldBackups old;
  ASSIGN_OR_RETURN(const auto backups, backupsIn(target.parent_path()));
  for (const std::filesystem::path& backup : backups) {
    const std::string name = backup.filename().string();
    if (name == newest) continue;
    // a name in the future was made while the clock was wrong: the backup's real age is unknown
    const bool is_later = name.substr(0, kNameShape.size()) > newest.substr(0, kNameShape.size());
    const bool is_own = isFileOf(own, backup) && (isPlainBackup(backup) || isEncryptedBackup(backup));
    (!is_own ? old.others : is_later ? old.later : older).push_back(backup);
  }
  // the new backup counts towards `keep`
  const std::size_t stay = keep > 0 ? keep - 1 : 0;
  older.resize(older.size() - std::min(stay, older.size()));
  std::error_code unknown;
  if (const auto written = std::filesystem::last_write_time(target, unknown); !unknown) {
    // if it was written to in the last day, another backup may still be making it
    for (const auto& partial : partialsIn(target.parent_path(), written - std::chrono::hours(24)))
      (isFileOf(own, partial) ? older : old.others).push_back(partial);
  }
  for (const auto& path : older) {
    if (by.unlink(path.c_str()) == 0) {
      old.removed.push_back(path);
      continue;
    }
    if (old.failed.empty()) old.why = systemError(path, "remove this old backup").message;
    old.failed.push_back(path);
  }
  return old;
}

std::string OldBackups::remainingText() const {
  std::vector<std::string> parts;
  if (!later.empty())
    parts.push_back(fmt::format(
        "{} backups are named by a later time (was the clock ahead?), the last is {}: they are left alone "
        "and do not count for --keep",
        later.size(), later.back().filename().string()));
  if (!others.empty())
    parts.push_back(
        fmt::format("{} files are named as backups, but another user made them, or they do not begin as a "
                    "backup, such as "
                    "{}: they are left alone and do not count for --keep",
                    others.size(), others.front().filename().string()));
  if (!failed.empty())
    parts.push_back(fmt::format("{} old backups could not be removed, such as {}", failed.size(), why));
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : "; ") + part;
  return text;
}

}  // namespace needlelab
