#include "db/service/restore.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/files.h"
#include "db/audit_head.h"
#include "db/check.h"
#include "db/connection.h"
#include "db/copied_tables.h"
#include "db/database_files.h"
#include "db/encrypted_backup.h"
#include "db/erasure_list.h"
#include "db/foreign_database.h"
#include "db/open_file.h"
#include "db/schema.h"
#include "db/service/bootstrap.h"
#include "db/store_address.h"
#include "needlelab/types.pb.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// Copies a backup to a plain file with access only for its owner, and syncs it. `key`: of an encrypted one.
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

/// The key of the backup; nothing for a plain one. Refuses a plain one where a key was given: it
/// may be a forged one, which stands in an encrypted one's place.
Result<std::optional<BackupKey>> keyFor(const fs::path& from, const fs::path& key_file) {
  const bool encrypted = isEncryptedBackup(from);
  if (key_file.empty() && !encrypted) return std::optional<BackupKey>();
  if (key_file.empty())
    return Error{ErrorCode::kInvalidInput,
                 "--from " + from.string() + ": is encrypted: give the file of its key (--key FILE)"};
  ASSIGN_OR_RETURN(auto key, BackupKey::read(key_file));
  if (!encrypted)
    return Error{
        ErrorCode::kInvalidInput,
        "--from " + from.string() +
            ": is no encrypted backup, but --key was given: it is another file, or its first bytes are "
            "damaged; leave --key away to restore a plain backup that you trust"};
  return std::optional<BackupKey>(std::move(key));
}

/// A person's or a station's row.
struct AccessRow {
  std::string secret;  ///< hash of the password or key
  bool shut = false;
  int role = 0;
  std::string name{};  ///< as people call it; the key is a person's ref
};

Result<std::map<std::string, AccessRow>> accessRows(Connection& connection, bool stations) {
  std::map<std::string, AccessRow> all;
  auto rows = connection.prepare(stations ? "SELECT name, key_hash, revoked, 0, name FROM stations"
                                          : "SELECT ref, coalesce(password_hash, ''), disabled, role, name"
                                            " FROM accounts");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return all;
    all[rows.text(0)] = {std::string(textOf(rows.bytes(1))), rows.integer(2) != 0,
                         static_cast<int>(rows.integer(3)), rows.text(4)};
  }
}

/// Why an access of the restored database was no longer valid in the replaced one; empty: it was valid.
std::string accessEnded(const AccessRow& restored, const AccessRow* replaced, bool station) {
  if (restored.shut || restored.secret.empty()) return {};
  if (replaced == nullptr) return "is not in the replaced database";
  if (replaced->shut) return station ? "its key was revoked" : "was disabled";
  if (replaced->secret != restored.secret)
    return station ? "had got a new key; the old one is valid again, the new one is not"
                   : "had a new password; the old one is valid again";
  if (replaced->role != restored.role)
    return "had become " + pb::Role_Name(replaced->role) + ", is " + pb::Role_Name(restored.role) + " again";
  return {};
}

/// Migrates the copy to this program's schema, reads all of it, and closes it without a log beside it.
Status migrateAndCheck(const fs::path& copy, const fs::path& from, RestoreResult& result) {
  // a schema takes up to 80 times its length of memory: first it is read within bounds
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

/// Ids that were given after the backup are not given again.
Status keepLastNumbers(const fs::path& database, const fs::path& copy) {
  std::error_code error;
  if (!fs::exists(database, error)) return {};
  auto replaced = Connection::open(database, {.mode = Connection::Mode::kFrozen});
  if (!replaced) return {};  // it may be the damaged one, for which the backup is restored
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
    return refused("--data", folder, "is no folder; for a machine of its own make it first (mkdir -m 700)");
  if (!fs::is_regular_file(from, error)) return refused("--from", from, "there is no such file");
  if (fs::exists(folder / kStoreFile, error))
    return refused("--data", folder,
                   "its database is on PostgreSQL, whose backups its own tools make and restore: see "
                   "deploy/OPERATIONS.md, PostgreSQL");
  if (fs::equivalent(from, database, error)) return refused("--from", from, "this is the database itself");
  for (const char* suffix : {"-wal", "-journal"})
    if (const fs::path log = from.string() + suffix; fs::exists(log, error) && fs::file_size(log, error) > 0)
      return refused(
          "--from", from,
          "there is a log beside it (" + log.string() + "): it is a database in use and no backup");
  ASSIGN_OR_RETURN(const auto key, keyFor(from, key_file));
  ASSIGN_OR_RETURN(const auto lock, FolderLock::take(folder, "needlelab-admin restore"));
  RETURN_IF_ERROR(finishRestore(folder));

  // who was erased since the backup was made, by the list beside it: the one here may be lost
  ASSIGN_OR_RETURN(const auto erasures, readErasures(from.parent_path(), kErasuresCopy));

  UnfinishedDatabase undecided(copy);
  // also of a file with holes, however little of the disk it has taken
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

Status finishRestore(const fs::path& folder) {
  const fs::path pending = folder / kRestorePending, database = folder / kDatabaseFile,
                 copy = folder / kRestoringCopy;
  std::error_code error;
  if (!fs::exists(pending, error)) return {};
  ASSIGN_OR_RETURN(const auto kept, readWholeFile(pending, 1000));
  // the copy exists until the last step, which moves it to the database's place
  if (fs::exists(copy, error)) {
    RETURN_IF_ERROR(keepReplacedDatabase(folder, kept, pending));
    RETURN_IF_ERROR(renameInFolder(copy, database));
    RETURN_IF_ERROR(syncFolder(folder));
  }
  // the restored log ends earlier than the kept head says, rightly
  const fs::path head = folder / kAuditHeadFile;
  if (::rename(head.c_str(), (folder / kReplacedAuditHeadFile).c_str()) != 0 && errno != ENOENT)
    return systemError(head, "put aside");
  if (::unlink(pending.c_str()) != 0 && errno != ENOENT) return systemError(pending, "remove");
  return syncFolder(folder);
}

Result<std::vector<RestoredAccess>> noteAccessValidAgain(Store& store, const fs::path& kept) {
  // nothing is written beside it
  ASSIGN_OR_RETURN(auto replaced, Connection::open(kept, {.mode = Connection::Mode::kFrozen}));
  std::vector<RestoredAccess> all;
  {
    ASSIGN_OR_RETURN(auto restored, store.readers().borrow());
    for (const bool station : {false, true}) {
      ASSIGN_OR_RETURN(const auto before, accessRows(replaced, station));
      ASSIGN_OR_RETURN(const auto now, accessRows(*restored, station));
      for (const auto& [name, row] : now) {
        const auto found = before.find(name);
        const std::string why = accessEnded(row, found == before.end() ? nullptr : &found->second, station);
        if (!why.empty())
          all.push_back(
              {row.name, name, station, std::string(station ? "station " : "user ") + row.name + ": " + why});
      }
    }
  }
  std::sort(all.begin(), all.end(), [](const RestoredAccess& a, const RestoredAccess& b) {
    return std::tie(a.station, a.name) < std::tie(b.station, b.name);
  });
  for (const RestoredAccess& one : all)
    RETURN_IF_ERROR(store.service().note(
        "local", "access valid again", one.ref,
        (one.station ? "station " : "user ") + one.ref + one.text.substr(one.text.find(": "))));
  return all;
}

}  // namespace needlelab
