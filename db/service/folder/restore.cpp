#include "db/service/folder/restore.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "db/audit/audit_head.h"
#include "db/backup/check.h"
#include "db/backup/copied_tables.h"
#include "db/backup/database_files.h"
#include "db/backup/encrypted_backup.h"
#include "db/backup/foreign_database.h"
#include "db/erasure/erasure_list.h"
#include "db/service/folder/data_folder.h"
#include "db/store/connection.h"
#include "db/store/open_file.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

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
/// forgery in place of an encrypted one.
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
                   "deploy/FACULTY.md");
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
