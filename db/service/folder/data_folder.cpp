#include "db/service/folder/data_folder.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/base/files/files.h"
#include "db/audit/audit_chain.h"
#include "db/audit/audit_head.h"
#include "db/backup/backup.h"
#include "db/backup/database_files.h"
#include "db/backup/old_backups.h"
#include "db/backup/store_copy.h"
#include "db/erasure/erasure_list.h"
#include "db/sessions/acknowledged.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// Files beside the database that a start reads or writes.
constexpr std::string_view kOwnFiles[] = {
    "lock",          "pseudonym.key",        kErasuresFile, kAuditKeyFile,     kAuditHeadFile,
    kRestorePending, kReplacedAuditHeadFile, kStoreFile,    kAcknowledgedFile, kServerFile};

/// Other files there: SQLite's, and what an undone restore leaves (deploy/OPERATIONS.md).
constexpr std::string_view kOthersOwnFiles[] = {"needlelab.db-wal", "needlelab.db-shm",
                                                "needlelab.db-journal", "audit.head.replaced-undone"};

bool isTemporary(std::string_view name) {
  return std::any_of(std::begin(kOwnFiles), std::end(kOwnFiles),
                     [&](std::string_view own) { return isTemporaryNameOf(own, name); });
}

/// Adds temporary files beside our own ones.
void addTemporary(const fs::path& folder, std::vector<fs::path>& left) {
  std::error_code error;
  for (auto at = fs::directory_iterator(folder, error); !error && at != fs::directory_iterator();
       at.increment(error))
    if (isTemporary(at->path().filename().string())) left.push_back(at->path());
}

}  // namespace

Status checkOwnFiles(const fs::path& folder) {
  for (const std::string_view name : kOwnFiles) RETURN_IF_ERROR(requireFileOrNothing(folder / name));
  return {};
}

std::vector<fs::path> removeFolderLeftovers(const fs::path& folder) {
  std::vector<fs::path> left;
  for (const fs::path& copy : {folder / kRestoringCopy, plainCopyBeside(folder / "needlelab.db")})
    for (const char* suffix : {"", "-wal", "-shm", "-journal"}) left.emplace_back(copy.string() + suffix);
  addTemporary(folder, left);
  for (const fs::path& place : {folder, folder / "backups"}) {
    std::error_code error;
    if (place != folder && !fs::is_directory(fs::symlink_status(place, error))) continue;
    const auto partials = partialsIn(place, fs::file_time_type::max());
    left.insert(left.end(), partials.begin(), partials.end());
  }
  std::erase_if(left, [](const fs::path& path) {
    struct stat info {};
    return ::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode) || ::unlink(path.c_str()) != 0;
  });
  std::sort(left.begin(), left.end());
  return left;
}

bool isOwnFile(const fs::path& folder, const fs::path& path) {
  const std::string file = path.filename().string();
  const std::string_view name = file;
  const fs::path in = path.parent_path();
  // of the authority, its successor and the server (common/wire/certificates.h)
  if (in == folder / "tls") {
    const std::string_view written = name.substr(0, name.find(kTemporaryMark));
    return (written == name || isTemporaryNameOf(written, name)) &&
           (written.ends_with(".crt") || written.ends_with(".key"));
  }
  const auto has = [&](const auto& names) {
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
  };
  return in == folder && (has(kOwnFiles) || has(kOthersOwnFiles) || isTemporary(name));
}

Status makeFolder(const std::filesystem::path& given) {
  if (given.empty())
    return Error{ErrorCode::kInvalidInput, "the data folder's name is empty: give --data DIR"};
  // DIR/ means DIR: the parent folder needs the sync
  const auto folder = given.has_filename() ? given : given.parent_path();
  std::error_code error;
  if (std::filesystem::is_directory(folder, error)) return {};
  const auto parent = folder.parent_path();
  if (!parent.empty()) std::filesystem::create_directories(parent, error);
  if (::mkdir(folder.c_str(), 0700) == 0) {
    // otherwise a power cut could lose the folder's own entry, and acknowledged data with it
    return syncFolder(parent);
  }
  if (errno != EEXIST) return systemError(folder, "make this folder");
  if (!std::filesystem::is_directory(folder, error))
    return Error{ErrorCode::kInvalidInput, folder.string() + ": is not a folder"};
  return {};
}

Result<FolderLock> FolderLock::take(const std::filesystem::path& folder, const std::string& holder) {
  const auto path = folder / "lock";
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return systemError(path, "open the lock file");
  FolderLock lock(fd);
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return systemError(path, "lock");
    char text[128] = {};
    const ssize_t count = ::pread(fd, text, sizeof(text) - 1, 0);
    const std::string who =
        count > 0 ? std::string(text, static_cast<std::size_t>(count)) : "another process";
    const bool server = who.rfind("needlelab-server", 0) == 0;
    return Error{ErrorCode::kUnavailable,
                 (server ? "a server is running on " + folder.string() + " (" + who + "): use --server"
                         : folder.string() + " is in use by " + who + ": try again when it is done")};
  }
  // only for the message above, also on a full disk: the kernel holds the actual lock
  const std::string text = fmt::format("{}, process {}", holder, ::getpid());
  [[maybe_unused]] const bool is_said =
      ::ftruncate(fd, 0) == 0 && ::pwrite(fd, text.data(), text.size(), 0) > 0;
  return lock;
}

FolderLock::FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

Status finishRestore(const fs::path& folder) {
  const fs::path pending = folder / kRestorePending, database = folder / kDatabaseFile,
                 copy = folder / kRestoringCopy;
  std::error_code error;
  if (!fs::exists(pending, error)) return {};
  ASSIGN_OR_RETURN(const auto kept, readWholeFile(pending, 1000));
  // the copy exists until the last step, which moves it into place
  if (fs::exists(copy, error)) {
    RETURN_IF_ERROR(keepReplacedDatabase(folder, kept, pending));
    RETURN_IF_ERROR(renameInFolder(copy, database));
    RETURN_IF_ERROR(syncFolder(folder));
  }
  // the restored log legitimately ends before the kept head
  const fs::path head = folder / kAuditHeadFile;
  if (::rename(head.c_str(), (folder / kReplacedAuditHeadFile).c_str()) != 0 && errno != ENOENT)
    return systemError(head, "put aside");
  if (::unlink(pending.c_str()) != 0 && errno != ENOENT) return systemError(pending, "remove");
  return syncFolder(folder);
}

Status finishStoreSwitch(const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(auto file, readStoreFile(folder));
  if (file && !file->kept.empty()) {
    RETURN_IF_ERROR(keepReplacedDatabase(folder, file->kept, folder / kStoreFile));
    file->kept.clear();
    return writeStoreFile(folder, *file);
  }
  const auto database = folder / kDatabaseFile, copy = folder / kCopyingDatabase;
  std::error_code error;
  if (file || std::filesystem::exists(database, error) || !std::filesystem::exists(copy, error)) return {};
  {
    ASSIGN_OR_RETURN(auto reader, Connection::open(copy, {.mode = Connection::Mode::kReader}));
    ASSIGN_OR_RETURN(const auto mark, readCopyMark(reader));
    if (!mark || !mark->compared) return {};  // it was not decided
  }
  RETURN_IF_ERROR(renameInFolder(copy, database));
  return syncFolder(folder);
}

}  // namespace needlelab
