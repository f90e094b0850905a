#include <fmt/core.h>

#include <map>
#include <utility>

#include "db/access_numbers.h"
#include "db/audit.h"
#include "db/backup.h"
#include "db/check.h"
#include "db/connection.h"
#include "db/credentials.h"
#include "db/erasure.h"
#include "db/old_backups.h"
#include "db/people.h"
#include "db/restored_backup.h"
#include "db/seen_time.h"
#include "db/service/export_ledger.h"
#include "db/service/handlers.h"
#include "db/service/service.h"
#include "db/store_address.h"

namespace needlelab::handlers {
namespace {

pb::BackupDone::Disk diskOf(const Context& context, const std::filesystem::path& backup) {
  static const BlockDevices kHere;
  switch (compareDisks(context.reader.path(), backup, context.disks != nullptr ? *context.disks : kHere)) {
    case DiskRelation::kAnother:
      return pb::BackupDone::ANOTHER_DISK;
    case DiskRelation::kSame:
      return pb::BackupDone::SAME_DISK;
    case DiskRelation::kUnknown:
      break;
  }
  return pb::BackupDone::DISK_UNKNOWN;
}

/// The file that a backup goes to; its name tells whether it is encrypted.
Result<std::filesystem::path> backupTarget(const Context& context, const pb::Backup& call) {
  const bool encrypted = context.backup_key != nullptr;
  std::filesystem::path target = call.path();
  if (call.keep() > 0)
    return target / backupName(context.now_unix_ns, encrypted ? kEncryptedEnding : kPlainEnding);
  const bool named_so = target.extension() == kEncryptedEnding;
  if (encrypted && !named_so) target += kEncryptedEnding;
  if (!encrypted && named_so)
    return Error{ErrorCode::kInvalidInput,
                 target.string() +
                     ": a backup of this name is encrypted, and there is no key: give the server one "
                     "(--backup-key FILE), or the command on a stopped server's folder "
                     "(--encrypt-with FILE), or choose another name"};
  return target;
}

/// On PostgreSQL: `path` is the address of a database into which its own tools restored a backup. Where that
/// backup lies, this server cannot see.
Result<pb::Reply> verifyRestored(const Context& context, const pb::Backup& call) {
  const bool is_address = call.path().starts_with("postgresql://") || call.path().starts_with("postgres://");
  if (!is_address || call.keep() > 0)
    return Error{ErrorCode::kInvalidInput,
                 "this lab's database is on PostgreSQL, whose own tools make its backups: deploy/faculty/"
                 "backup, or pg_basebackup or pg_dump by hand. Restore one elsewhere, and give the address "
                 "of that database, postgresql://USER@HOST/DATABASE, to needlelab-admin backup verified "
                 "(deploy/OPERATIONS.md, PostgreSQL)"};
  // the log has it whatever answers there
  const auto note = [&] {
    return write(context, call.path(), "to be compared with this database",
                 [](Connection&) { return Status(); });
  };
  auto restored = openFromOutside(context.reader.path(), call.path(), note);
  if (!restored) return wrongStore(restored.error());
  auto compared = compareRestored(context.reader, *restored, context.cancelled);
  if (!compared) return wrongStore(compared.error());
  RestoredBackup& backup = *compared;
  if (!call.counts_as_safe()) backup.result.covered.clear();
  const std::string detail = fmt::format(
      "restored and verified, {} chunks, {}{}", backup.result.chunks_verified,
      call.counts_as_safe() ? "Safe because it was asked for" : "on a disk that is not known: not Safe",
      backup.result.undecodable_chunks == 0 ? ""
                                            : fmt::format(", and {} that cannot be decoded and are not Safe",
                                                          backup.result.undecodable_chunks));
  RETURN_IF_ERROR(write(context, call.path(), detail, [&](Connection& writer) {
    return recordRestored(writer, backup, context.now_unix_ns);
  }));
  pb::Reply reply;
  auto* done = reply.mutable_backup_done();
  done->set_disk(pb::BackupDone::DISK_UNKNOWN);
  done->set_safe(call.counts_as_safe());
  done->set_path(call.path());
  done->set_chunks_verified(backup.result.chunks_verified);
  done->set_undecodable_chunks(backup.result.undecodable_chunks);
  return reply;
}

/// Whether the account's access is the one that `who` logged in with, as far as that is compared.
Result<bool> hasNumber(Connection& connection, AccessWhat what, const Principal& who) {
  if (!who.access_number) return true;
  ASSIGN_OR_RETURN(const std::int64_t number, AccessNumberStore(connection).of(what, who.name));
  return number == *who.access_number;
}

}  // namespace

Result<bool> accessHolds(Connection& connection, const Principal& who) {
  if (who.role == pb::STATION) {
    ASSIGN_OR_RETURN(const auto station, StationStore(connection).find(who.name));
    if (!station || station->revoked) return false;
    return hasNumber(connection, AccessWhat::kStation, who);
  }
  ASSIGN_OR_RETURN(const bool is_unchanged, hasNumber(connection, AccessWhat::kPerson, who));
  if (!is_unchanged) return false;
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection).find(who.name));
  return person && !person->disabled && person->role == who.role;
}

Result<std::vector<bool>> accessHoldsOf(Connection& connection, std::span<const Principal> all) {
  std::vector<std::string> people, stations;
  for (const Principal& who : all) (who.role == pb::STATION ? stations : people).push_back(who.name);
  ASSIGN_OR_RETURN(const auto view, Transaction::view(connection));
  ASSIGN_OR_RETURN(const auto accounts, PeopleStore(connection).findAll(people));
  ASSIGN_OR_RETURN(const auto of_people, AccessNumberStore(connection).ofMany(AccessWhat::kPerson, people));
  ASSIGN_OR_RETURN(const auto of_stations,
                   AccessNumberStore(connection).ofMany(AccessWhat::kStation, stations));
  std::map<std::string, bool> in_use;
  if (!stations.empty()) {
    ASSIGN_OR_RETURN(const auto known, StationStore(connection).list());
    for (const Station& station : known) in_use[station.name] = !station.revoked;
  }
  std::vector<bool> hold;
  for (const Principal& who : all) {
    const bool is_station = who.role == pb::STATION;
    const auto& numbers = is_station ? of_stations : of_people;
    const auto number = numbers.find(who.name);
    const bool is_unchanged =
        !who.access_number || *who.access_number == (number == numbers.end() ? 0 : number->second);
    const auto person = accounts.find(who.name);
    const auto station = in_use.find(who.name);
    hold.push_back(is_unchanged && (is_station ? station != in_use.end() && station->second
                                               : person != accounts.end() && !person->second.disabled &&
                                                     person->second.role == who.role));
  }
  return hold;
}

Status keepOwnAccess(const Context& context, Connection& writer, const std::string& name) {
  if (context.under_way == nullptr || context.who.name != name || !context.who.access_number) return {};
  ASSIGN_OR_RETURN(context.under_way->access_number, AccessNumberStore(writer).of(AccessWhat::kPerson, name));
  return {};
}

Status checkAccess(Connection& connection, const Principal& who) {
  if (!who.logged_in) return {};
  ASSIGN_OR_RETURN(const bool holds, accessHolds(connection, who));
  if (holds) return {};
  return Error{ErrorCode::kDenied,
               who.name + ": access was withdrawn, or the role was changed: log in again"};
}

Status write(const Context& context, const std::string& subject, const std::string& detail,
             const std::function<Status(Connection&)>& work) {
  return writeIfChanged(context, subject, detail, [&](Connection& writer) -> Result<bool> {
    RETURN_IF_ERROR(work(writer));
    return true;
  });
}

Status writeIfChanged(const Context& context, const std::string& subject, const std::string& detail,
                      const std::function<Result<bool>(Connection&)>& work) {
  return context.writer.run([&](Connection& writer) -> Status {
    RETURN_IF_ERROR(checkAccess(writer, context.who));
    ASSIGN_OR_RETURN(const bool changed, work(writer));
    if (!changed) return {};
    return AuditStore(writer).add(
        {0, context.now_unix_ns, context.who.name, std::string(context.action), subject, detail});
  });
}

Status edit(const Context& context, const std::string& subject, const std::string& detail,
            const std::function<Status(Connection&)>& work) {
  return write(context, subject, detail, [&](Connection& writer) -> Status {
    const Status done = work(writer);
    if (done || done.error().code != ErrorCode::kConflict || done.error().current_revision == 0) return done;
    Error conflict = done.error();
    // an import of a class table may also have changed the person
    const std::string_view other = context.action == "user change" ? "user import" : context.action;
    // on the writer: a later change was not the one that came first
    auto row = writer.query(
        "SELECT detail FROM audit WHERE subject = ? AND action IN (?, ?) ORDER BY id DESC LIMIT 1", subject,
        context.action, other);
    const auto found = row.step();
    if (found && *found && !row.text(0).empty()) conflict.message += ". What came first: " + row.text(0);
    return conflict;
  });
}

Status noteRead(const Context& context, const std::string& subject, const std::string& detail) {
  const std::string what = std::string(context.action) + "\n" + subject + "\n" + detail;
  if (!context.exports.isNew(context.who, what, context.now_unix_ns)) return {};
  const Status noted = writeIfChanged(context, subject, detail, [&](Connection& writer) {
    return context.exports.isNewElsewhere(writer, context.who, what);
  });
  if (context.writer.failed()) return {};
  if (!noted.ok()) context.exports.takeBack(context.who, what);
  return noted;
}

void noteAccessChanged(const Context& context) {
  if (context.under_way != nullptr) context.under_way->access_changed = true;
}

pb::Reply doneReply() {
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

Result<pb::Reply> backup(const Context& context, const pb::Backup& call) {
  if (context.reader.sqlite() == nullptr) return verifyRestored(context, call);
  const BackupKey* const key = context.backup_key;
  ASSIGN_OR_RETURN(const auto target, backupTarget(context, call));
  ASSIGN_OR_RETURN(auto result, key != nullptr
                                    ? encryptedBackupTo(context.reader, target, *key, context.cancelled)
                                    : backupTo(context.reader, target, context.cancelled));
  const pb::BackupDone::Disk disk = diskOf(context, target);
  // a station deletes what is Safe: one fault of a disk must not take the database and the backup
  const bool safe = disk == pb::BackupDone::ANOTHER_DISK || call.counts_as_safe();
  if (!safe) result.covered.clear();
  std::string detail = fmt::format(
      "{} bytes, {} chunks, {}{}", result.bytes, result.chunks_verified,
      key != nullptr ? "encrypted with the key " + key->idText() + ", " : "",
      safe
          ? (disk == pb::BackupDone::ANOTHER_DISK ? "on another disk: Safe" : "Safe because it was asked for")
          : "not on another disk: not Safe");
  if (result.undecodable_chunks > 0)
    detail += fmt::format(", and {} that cannot be decoded and are not Safe", result.undecodable_chunks);
  RETURN_IF_ERROR(write(context, target.string(), detail, [&](Connection& writer) {
    return recordBackup(writer, result, target, context.now_unix_ns);
  }));
  const auto list = writeErasuresBeside(context.reader, target.parent_path());
  pb::Reply reply;
  auto* done = reply.mutable_backup_done();
  done->set_disk(disk);
  done->set_safe(safe);
  done->set_encrypted(key != nullptr);
  done->set_path(target.string());
  done->set_bytes(result.bytes);
  done->set_chunks_verified(result.chunks_verified);
  done->set_undecodable_chunks(result.undecodable_chunks);
  OldBackups old;
  if (call.keep() > 0) {
    // remove old backups only after the newer one is verified and recorded
    ASSIGN_OR_RETURN(old, removeOldBackups(target, call.keep()));
    for (const auto& path : old.removed) done->add_removed(path.string());
    if (const std::string left = old.leftText(); !left.empty())
      RETURN_IF_ERROR(write(context, target.string(), left, [](Connection&) { return Status(); }));
  }
  // at last: old backups go all the same
  if (!list)
    return Error{ErrorCode::kFailed,
                 fmt::format("{}: the backup is made and verified, but the list of erasures beside it could "
                             "not be written ({}), so people who were erased come back where it is restored "
                             "on another machine. Mend that, then make another backup, or copy {} to {}",
                             target.string(), list.error().message,
                             (context.reader.path().parent_path() / kErasuresFile).string(),
                             (target.parent_path() / kErasuresCopy).string())};
  if (!old.failed.empty())
    return Error{
        ErrorCode::kFailed,
        fmt::format("{}: the backup is made and verified, but {} of {} old backups could not be removed, "
                    "such as {}. Remove them by hand, or the disk fills",
                    target.string(), old.failed.size(), old.failed.size() + old.removed.size(), old.why)};
  return reply;
}

Result<pb::Reply> check(const Context& context, const pb::Check&) {
  const CancelScope may_end(context.reader, context.cancelled);
  ASSIGN_OR_RETURN(const auto result, checkDatabase(context.reader));
  pb::Reply reply;
  auto* report = reply.mutable_check_report();
  report->set_ok(result.ok() && result.undecodable.empty() && result.sums.empty());
  report->set_sessions(result.sessions);
  report->set_chunks(result.chunks);
  for (const std::string& fault : result.faults) report->add_faults(fault);
  for (const std::string& fault : result.undecodable) report->add_faults(fault);
  for (const std::string& fault : result.sums) report->add_faults(fault);
  if (context.writer.counters().log_pending) {
    report->set_ok(false);
    report->add_faults(
        "an erasure is pending: the log beside the database still has what was erased, because somebody "
        "reads; it is overwritten when that is done, or by the next start");
  }
  ASSIGN_OR_RETURN(const auto ahead, SeenTimeStore(context.reader).aheadText(context.now_unix_ns));
  if (!ahead.empty()) {
    report->set_ok(false);
    report->add_faults(ahead);
  }
  // the list that keeps erased people erased after a restore
  const auto folder = context.reader.path().parent_path();
  const auto lists_agree = [&]() -> Status {
    ASSIGN_OR_RETURN(const auto listed, readErasures(folder));
    ASSIGN_OR_RETURN(const auto known, ErasureStore(context.reader).known());
    const auto lacks = [](const std::vector<ErasureLine>& list, const std::vector<ErasureLine>& of) {
      return std::any_of(of.begin(), of.end(), [&](const ErasureLine& line) {
        return std::none_of(list.begin(), list.end(),
                            [&](const ErasureLine& one) { return one.person == line.person; });
      });
    };
    if (std::error_code error; !known.empty() && !std::filesystem::exists(folder / "pseudonym.key", error))
      return Error{
          ErrorCode::kCorrupt,
          fmt::format("{}: is missing, although people were erased: a late session under the name of "
                      "one of them would be a namesake's. Put it back from where keys are kept "
                      "(deploy/OPERATIONS.md)",
                      (folder / "pseudonym.key").string())};
    if (lacks(listed, known))
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{}: lacks erasures that the database has: after a restore of an older backup "
                               "these people would be back. The next start adds them",
                               (folder / kErasuresFile).string())};
    const auto backups = backupsFolder(context.reader);
    if (backups.empty()) return {};
    ASSIGN_OR_RETURN(const auto beside, readErasures(backups, kErasuresCopy));
    if (!lacks(beside, listed)) return {};
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: lacks erasures: a backup there that is restored on another machine would "
                             "bring these people back. The next backup adds them",
                             (backups / kErasuresCopy).string())};
  };
  if (const Status agree = lists_agree(); !agree) {
    report->set_ok(false);
    report->add_faults(agree.error().message);
  }
  return reply;
}

Result<pb::Reply> listAudit(const Context& context, const pb::ListAudit& call) {
  ASSIGN_OR_RETURN(const auto before, numberOfPage(call.page()));
  ASSIGN_OR_RETURN(const auto entries,
                   AuditStore(context.reader).list(call.limit(), before, call.who(), call.action()));
  pb::Reply reply;
  auto* list = reply.mutable_audit();
  PageRoom room;
  for (const AuditRow& row : entries) {
    pb::AuditEntry entry;
    entry.set_id(row.id);
    entry.set_unix_ns(row.unix_ns);
    entry.set_who(row.who);
    entry.set_action(row.action);
    entry.set_subject(row.subject);
    entry.set_detail(row.detail);
    if (!room.take(entry)) break;
    // ids begin with 1: there is no further page
    list->set_next_page(row.id > 1 ? std::to_string(row.id) : std::string());
    *list->add_entries() = std::move(entry);
  }
  return reply;
}

}  // namespace needlelab::handlers
