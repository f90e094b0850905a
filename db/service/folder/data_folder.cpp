#include "db/service/folder/data_folder.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "db/audit/audit_chain.h"
#include "db/audit/audit_head.h"
#include "db/backup/backup.h"
#include "db/backup/check.h"
#include "db/backup/copied_tables.h"
#include "db/backup/database_files.h"
#include "db/backup/encrypted_backup.h"
#include "db/backup/foreign_database.h"
#include "db/backup/old_backups.h"
#include "db/backup/store_copy.h"
#include "db/erasure/erasure.h"
#include "db/sessions/acknowledged.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// Files beside the database that a start reads or writes.
constexpr std::string_view kOwnFiles[] = {
    "lock",          "pseudonym.key",        kErasuresFile, kAuditKeyFile,     kAuditHeadFile,
    kRestorePending, kReplacedAuditHeadFile, kStoreFile,    kAcknowledgedFile, kServerFile};

/// Other files there: SQLite's, and what an undone restore leaves (OPERATIONS.md).
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
  for (const fs::path& copy : {folder / kRestoringCopy, plainCopyPath(folder / "needlelab.db")})
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

namespace {

/// Copies a backup to a plain file that only its owner can access, and syncs it. `key`: if it is encrypted.
Status copyFile(const fs::path& from, const fs::path& to, const std::optional<BackupKey>& key) {
  const OpenFile out(::open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!out.isOpen()) return systemError(to, "make");
  if (key) {
    const auto read = decryptFile(from, *key, [&](ByteView bytes) { return writeFully(out, to, bytes); });
    if (!read) return read.error();
  } else {
    const OpenFile in(::open(from.c_str(), O_RDONLY | O_CLOEXEC));
    if (!in.isOpen()) return Error{ErrorCode::kInvalidInput, systemError(from, "read").message};
    Bytes piece(1u << 20);
    for (;;) {
      ASSIGN_OR_RETURN(const std::size_t count, readFully(in, from, piece.data(), piece.size()));
      if (count == 0) break;
      RETURN_IF_ERROR(writeFully(out, to, ByteView(piece).first(count)));
    }
  }
  return ::fsync(out.fd()) == 0 ? Status() : Status(systemError(to, "fsync"));
}

/// The backup's key; nothing for a plain backup. Refuses a plain backup if a key was given: it may be a
/// forgery instead of an encrypted one.
Result<std::optional<BackupKey>> keyFor(const fs::path& from, const fs::path& key_file) {
  const bool encrypted = isEncryptedBackup(from);
  if (key_file.empty() && !encrypted) return std::optional<BackupKey>();
  if (key_file.empty())
    return Error{ErrorCode::kInvalidInput,
                 "--from " + from.string() + ": is encrypted: give the file of its key (--key FILE)"};
  ASSIGN_OR_RETURN(auto key, BackupKey::read(key_file));
  if (!encrypted)
    return Error{ErrorCode::kInvalidInput,
                 "--from " + from.string() +
                     ": is not an encrypted backup, but --key was given: it is another file, or its first "
                     "bytes are damaged; leave --key away to restore a plain backup that you trust"};
  return std::optional<BackupKey>(std::move(key));
}

/// Migrates the copy to this program's schema, reads all of it, and closes it without a log beside it.
Status migrateAndCheck(const fs::path& copy, const fs::path& from, RestoreResult& result) {
  // a schema takes up to 80 times its length in memory: first read it within limits
  if (const auto opened = openForeign(copy, nullptr, std::chrono::minutes(10)); !opened) {
    Error error = opened.error();
    if (error.message.starts_with(copy.string()))
      error.message.replace(0, copy.string().size(), from.string());
    return error;
  }
  ASSIGN_OR_RETURN(auto writer, Connection::open(copy, {.mode = Connection::Mode::kWriter, .copy_of = from}));
  RETURN_IF_ERROR(migrate(writer));
  ASSIGN_OR_RETURN(const auto checked, checkDatabase(writer));
  if (!checked.ok())
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: fails its check, nothing was changed: {} ({} faults); take another backup",
                             from.string(), checked.faults.front(), checked.faults.size())};
  result.sessions = checked.sessions;
  result.chunks = checked.chunks;
  return closeIntoOneFile(std::move(writer));
}

/// Keeps ids issued after the backup from being reused.
Status keepLastNumbers(const fs::path& database, const fs::path& copy) {
  std::error_code error;
  if (!fs::exists(database, error)) return {};
  auto replaced = Connection::open(database, {.mode = Connection::Mode::kFrozen});
  if (!replaced) return {};  // it may be the damaged database that this restore replaces
  auto before = lastNumbersOf(*replaced);
  if (!before) return {};
  ASSIGN_OR_RETURN(auto writer, Connection::open(copy, {.mode = Connection::Mode::kWriter}));
  {
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
    ASSIGN_OR_RETURN(auto numbers, lastNumbersOf(writer));
    numbers["people"] = std::max(numbers["people"], (*before)["people"]);
    RETURN_IF_ERROR(setLastNumbers(writer, numbers));
    RETURN_IF_ERROR(transaction.commit());
  }
  return closeIntoOneFile(std::move(writer));
}

}  // namespace

Result<RestoreResult> restoreFrom(const fs::path& folder, const fs::path& from, std::int64_t now_unix_ns,
                                  const fs::path& key_file) {
  const fs::path database = folder / kDatabaseFile, copy = folder / kRestoringCopy;
  const auto refused = [](const char* option, const fs::path& path, const std::string& why) {
    return Error{ErrorCode::kInvalidInput, fmt::format("{} {}: {}", option, path.string(), why)};
  };
  std::error_code error;
  if (!fs::is_directory(folder, error))
    return refused("--data", folder,
                   "is not a folder; for a machine of its own make it first (mkdir -m 700)");
  if (!fs::is_regular_file(from, error)) return refused("--from", from, "there is no such file");
  if (fs::exists(folder / kStoreFile, error))
    return refused("--data", folder,
                   "its database is on PostgreSQL, whose backups its own tools make and restore: see "
                   "FACULTY.md");
  if (fs::equivalent(from, database, error)) return refused("--from", from, "this is the database itself");
  for (const char* suffix : {"-wal", "-journal"})
    if (const fs::path log = from.string() + suffix; fs::exists(log, error) && fs::file_size(log, error) > 0)
      return refused(
          "--from", from,
          "there is a log beside it (" + log.string() + "): it is a database in use and no backup");
  ASSIGN_OR_RETURN(const auto key, keyFor(from, key_file));
  ASSIGN_OR_RETURN(const auto lock, FolderLock::take(folder, "needlelab-admin restore"));
  RETURN_IF_ERROR(finishRestore(folder));

  // people erased since the backup, by the list beside it: the list here may be lost
  ASSIGN_OR_RETURN(const auto erasures, readErasures(from.parent_path(), kErasuresCopy));

  UnfinishedDatabase undecided(copy);
  // also for sparse files, however little of the disk they use
  const auto space = fs::space(folder, error);
  const std::uintmax_t bytes = error ? 0 : fs::file_size(from, error);
  if (!error && space.available < bytes)
    return Error{ErrorCode::kNoRoom,
                 fmt::format("--data {}: the disk has {} MiB left, and the copy of {} needs {}: make room, "
                             "nothing was changed",
                             folder.string(), space.available >> 20, from.string(), (bytes >> 20) + 1)};
  RETURN_IF_ERROR(copyFile(from, copy, key));
  RestoreResult result;
  RETURN_IF_ERROR(migrateAndCheck(copy, from, result));
  RETURN_IF_ERROR(addErasures(folder, erasures));

  RETURN_IF_ERROR(keepLastNumbers(database, copy));

  // the decision: from here on this program, or the next one that opens the folder, completes the restore
  const std::string kept = freeNameIn(folder, kReplacedDatabase, now_unix_ns);
  if (fs::exists(database, error)) result.kept = folder / kept;
  RETURN_IF_ERROR(syncFolder(folder));
  RETURN_IF_ERROR(writeFileAtomically(folder / kRestorePending, viewOf(kept), 0600));
  undecided.keep();
  RETURN_IF_ERROR(finishRestore(folder));
  return result;
}

}  // namespace needlelab
