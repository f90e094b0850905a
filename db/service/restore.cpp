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
#include <set>
#include <string>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/files.h"
#include "db/audit.h"
#include "db/audit_head.h"
#include "db/check.h"
#include "db/connection.h"
#include "db/database_files.h"
#include "db/encrypted_backup.h"
#include "db/erasure.h"
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

/// The key of the backup; nothing for a plain one. Refuses a plain one where a key was given: whoever can
/// write to the backups could put a forged one in an encrypted one's place.
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

/// Whether the copy is a database whose schema this program knows.
Status checkCopy(const fs::path& copy, const fs::path& from) {
  // a schema takes up to 80 times its length of memory: first it is read within bounds
  const auto opened = openForeign(copy, nullptr, std::chrono::minutes(10));
  if (opened) return {};
  Error error = opened.error();
  if (error.message.starts_with(copy.string())) error.message.replace(0, copy.string().size(), from.string());
  return error;
}

/// Takes out whom the next start erases anew by one of `erasures`: their access is not valid again, and their
/// name must not stand in a text that outlives the erasure.
Status leaveOutErased(Connection& writer, std::vector<ErasureLine> erasures,
                      std::vector<RestoredAccess>& again) {
  ASSIGN_OR_RETURN(const auto rows, writer.prepare("SELECT pseudonym FROM erasures").all(firstText));
  const std::set<std::string> known(rows.begin(), rows.end());
  std::erase_if(erasures, [&](const ErasureLine& line) { return known.contains(line.pseudonym); });
  std::error_code error;
  // without the key nobody is erased anew: the server's log and `check` say so
  if (erasures.empty() || !fs::exists(writer.path().parent_path() / "pseudonym.key", error)) return {};
  ASSIGN_OR_RETURN(const auto key, ErasureStore(writer).key());
  std::set<PseudonymKey::Hash> erased;
  for (const ErasureLine& line : erasures)
    if (!line.without_account) erased.insert(line.name_hash);  // that takes no account
  std::erase_if(again, [&](const RestoredAccess& one) {
    return !one.station && erased.contains(key.nameHash(one.name));
  });
  return {};
}

/// Records in the copy the accesses that the replaced database had withdrawn and the copy has not, so that
/// any program that completes the restore reports them. Continues when the replaced database cannot be read.
Status noteAccess(Connection& writer, const fs::path& replaced, const fs::path& from,
                  const std::vector<ErasureLine>& erasures, std::int64_t now_unix_ns, RestoreResult& result) {
  std::error_code error;
  if (!fs::exists(replaced, error)) return {};
  auto old = Connection::open(replaced, {.mode = Connection::Mode::kReader});
  if (!old) {
    result.not_compared = old.error().message;
  } else {
    auto again = accessValidAgain(*old, writer);
    if (again) {
      result.valid_again = std::move(*again);
      RETURN_IF_ERROR(leaveOutErased(writer, erasures, result.valid_again));
    } else {
      result.not_compared = again.error().message;
    }
  }
  const auto add = [&](const std::string& subject, const std::string& text) {
    return AuditStore(writer).add({0, now_unix_ns, "local", "access valid again", subject, text});
  };
  std::string lines;
  for (const RestoredAccess& one : result.valid_again) {
    RETURN_IF_ERROR(add(one.name, one.text + " (restored from " + from.string() + ")"));
    lines += (lines.empty() ? "" : "; ") + one.text;
  }
  if (!result.not_compared.empty()) {
    lines = "the replaced database could not be read (" + result.not_compared +
            "): accounts and keys are those of the backup";
    RETURN_IF_ERROR(add("(all)", lines));
  }
  return MetaStore(writer).set("access_valid_again", lines);
}

/// Migrates the copy to this program's schema, closes it without a log beside it, and then reads all of it.
Status migrateAndCheck(const fs::path& copy, const fs::path& from, const fs::path& replaced,
                       const std::vector<ErasureLine>& erasures, std::int64_t now_unix_ns,
                       RestoreResult& result) {
  ASSIGN_OR_RETURN(auto writer, Connection::open(copy, {.mode = Connection::Mode::kWriter, .copy_of = from}));
  RETURN_IF_ERROR(migrate(writer));
  ASSIGN_OR_RETURN(const auto checked, checkDatabase(writer));
  if (!checked.ok())
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: fails its check, nothing was changed: {} ({} faults); take another backup",
                             from.string(), checked.faults.front(), checked.faults.size())};
  result.sessions = checked.sessions;
  result.chunks = checked.chunks;
  RETURN_IF_ERROR(noteAccess(writer, replaced, from, erasures, now_unix_ns, result));
  return closeIntoOneFile(std::move(writer));
}

}  // namespace

Result<RestoreResult> restoreFrom(const fs::path& folder, const fs::path& from, std::int64_t now_unix_ns,
                                  const fs::path& key_file) {
  std::error_code error;
  if (!fs::is_directory(folder, error))
    return Error{ErrorCode::kInvalidInput,
                 "--data " + folder.string() +
                     ": is no folder; for a machine of its own make it first (mkdir -m 700)"};
  if (!fs::is_regular_file(from, error))
    return Error{ErrorCode::kInvalidInput, "--from " + from.string() + ": there is no such file"};
  if (fs::exists(folder / kStoreFile, error))
    return Error{ErrorCode::kInvalidInput,
                 "--data " + folder.string() +
                     ": its database is on PostgreSQL, whose backups its own tools make and restore: see "
                     "deploy/OPERATIONS.md, PostgreSQL"};
  const fs::path database = folder / kDatabaseFile, copy = folder / kRestoringCopy;
  if (fs::equivalent(from, database, error))
    return Error{ErrorCode::kInvalidInput, "--from " + from.string() + ": this is the database itself"};
  for (const char* suffix : {"-wal", "-journal"})
    if (const fs::path log = from.string() + suffix; fs::exists(log, error) && fs::file_size(log, error) > 0)
      return Error{ErrorCode::kInvalidInput, "--from " + from.string() + ": there is a log beside it (" +
                                                 log.string() + "): it is a database in use and no backup"};
  ASSIGN_OR_RETURN(const auto key, keyFor(from, key_file));
  ASSIGN_OR_RETURN(const auto lock, FolderLock::take(folder, "needlelab-admin restore"));
  RETURN_IF_ERROR(finishRestore(folder));

  // who was erased since the backup was made, by the list here and by the one beside the backup, which is
  // that of a machine that is lost
  ASSIGN_OR_RETURN(auto erasures, erasuresBeside(from.parent_path(), folder));
  ASSIGN_OR_RETURN(auto all_erasures, readErasures(folder));

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
  RETURN_IF_ERROR(checkCopy(copy, from));
  RestoreResult result;
  all_erasures.insert(all_erasures.end(), erasures.lines.begin(), erasures.lines.end());
  RETURN_IF_ERROR(migrateAndCheck(copy, from, database, all_erasures, now_unix_ns, result));
  RETURN_IF_ERROR(
      addErasures(folder, erasures.lines, kErasuresFile, erasures.key ? &*erasures.key : nullptr));
  result.erasure_notes = std::move(erasures.notes);

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

namespace {

/// A person's or a station's row: its secret, and whether access is disabled.
struct AccessRow {
  std::string secret;  ///< hash of the password or key
  bool shut = false;
  int role = 0;
};
using AccessRows = std::map<std::string, AccessRow>;

Result<AccessRows> accessRows(Connection& connection, const char* sql) {
  AccessRows all;
  auto rows = connection.prepare(sql);
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row) return all;
    AccessRow& one = all[std::string(rows.text(0))];
    one.secret = std::string(textOf(rows.bytes(1)));
    one.shut = rows.integer(2) != 0;
    one.role = static_cast<int>(rows.integer(3));
  }
}

/// The reason why an access of the restored database was no longer valid in the replaced one; empty: it was
/// valid.
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

}  // namespace

Result<std::vector<RestoredAccess>> accessValidAgain(Connection& replaced, Connection& restored) {
  std::vector<RestoredAccess> all;
  for (const bool station : {false, true}) {
    const char* const sql = station ? "SELECT name, key_hash, revoked, 0 FROM stations"
                                    : "SELECT name, coalesce(password_hash, ''), disabled, role FROM people";
    ASSIGN_OR_RETURN(const auto before, accessRows(replaced, sql));
    ASSIGN_OR_RETURN(const auto now, accessRows(restored, sql));
    for (const auto& [name, row] : now) {
      const auto found = before.find(name);
      const std::string why = accessEnded(row, found == before.end() ? nullptr : &found->second, station);
      if (!why.empty())
        all.push_back({name, station, std::string(station ? "station " : "user ") + name + ": " + why});
    }
  }
  return all;
}

}  // namespace needlelab
