#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <utility>

#include "db/audit/audit.h"
#include "db/backup/backup.h"
#include "db/backup/check.h"
#include "db/backup/foreign_database.h"
#include "db/backup/old_backups.h"
#include "db/erasure/erasure.h"
#include "db/erasure/retention_store.h"
#include "db/service/context/backups.h"
#include "db/service/context/long_work.h"
#include "db/service/records/erasures.h"
#include "db/service/records/retention_runs.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/requests.h"
#include "db/sessions/seen_time.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab::handlers {
namespace {

pb::BackupDone::Disk diskOf(const Context& context, const std::filesystem::path& backup) {
  switch (compareDisks(context.reader.path(), backup, context.parts.backups.disks())) {
    case DiskRelation::kAnother:
      return pb::BackupDone::ANOTHER_DISK;
    case DiskRelation::kSame:
      return pb::BackupDone::SAME_DISK;
    case DiskRelation::kUnknown:
      break;
  }
  return pb::BackupDone::DISK_UNKNOWN;
}

/// The target file of a backup; its name tells whether it is encrypted.
Result<std::filesystem::path> backupTarget(const Context& context, const pb::Backup& call) {
  const bool encrypted = context.parts.backups.key() != nullptr;
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

/// PostgreSQL only: `path` is the address of a database into which PostgreSQL's tools restored a backup. This
/// server cannot see where the backup itself is.
Result<pb::Reply> verifyRestored(const Context& context, const pb::Backup& call) {
  const bool is_address = call.path().starts_with("postgresql://") || call.path().starts_with("postgres://");
  if (!is_address || call.keep() > 0)
    return Error{
        ErrorCode::kInvalidInput,
        "this lab's database is on PostgreSQL, whose own tools make its backups: the script "
        "faculty/backup, or pg_basebackup or pg_dump by hand. Restore one elsewhere, and give the address "
        "of that database, postgresql://USER@HOST/DATABASE, to needlelab-admin backup verified "
        "(FACULTY.md)"};
  // logged even if nothing answers there
  const auto note = [&] {
    return write(context, call.path(), "to be compared with this database",
                 [](Connection&) { return Status(); });
  };
  auto restored = openFromOutside(context.reader.path(), call.path(), note);
  if (!restored) return wrongStore(restored.error());
  auto compared = compareRestored(context.reader, *restored, &context.parts.long_work.cancelled);
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

Result<pb::Reply> runBackup(const Context& context, const pb::Backup& call) {
  if (context.reader.sqlite() == nullptr) return verifyRestored(context, call);
  const BackupKey* const key = context.parts.backups.key();
  ASSIGN_OR_RETURN(const auto target, backupTarget(context, call));
  ASSIGN_OR_RETURN(auto result,
                   key != nullptr
                       ? encryptedBackupTo(context.reader, target, *key, &context.parts.long_work.cancelled)
                       : backupTo(context.reader, target, &context.parts.long_work.cancelled));
  const pb::BackupDone::Disk disk = diskOf(context, target);
  // stations delete what is Safe: one failing disk must not take both the database and the backup
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
  const auto list = writeErasuresNextToBackups(context.reader, target.parent_path());
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
    if (const std::string left = old.remainingText(); !left.empty())
      RETURN_IF_ERROR(write(context, target.string(), left, [](Connection&) { return Status(); }));
  }
  // reported last: old backups are removed even if this failed
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

std::string textOfPolicy(const pb::RetentionPolicy& policy) {
  std::string text;
  if (policy.has_thin_after_days()) {
    text = fmt::format("thin after {} days to {:f} Hz", policy.thin_after_days(), policy.thin_rate_hz());
  }
  if (policy.has_delete_after_days())
    text += (text.empty() ? "" : ", ") + (fmt::format("delete after {} days", policy.delete_after_days()));
  if (text.empty()) text = "keep";
  return text + (policy.without_backup() ? ", also without a backup" : "");
}

}  // namespace

Result<pb::Reply> backup(const ServiceParts& parts, const Principal& who, const pb::Backup& call,
                         RequestUnderWay& under_way) {
  const Backups::Turn turn(parts.backups);
  if (!turn.isMine())
    return Error{ErrorCode::kUnavailable, "another backup is under way: try again when it is done"};
  return withReader(parts, who, callName(pb::Request::kBackup), under_way,
                    [&](const Context& context) { return runBackup(context, call); });
}

Result<pb::Reply> check(const Context& context, const pb::Check&) {
  const CancelScope may_end(context.reader, &context.parts.long_work.cancelled);
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
                      "(OPERATIONS.md)",
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

Result<pb::Reply> listRetention(const Context& context, const pb::ListRetention&) {
  RetentionStore store(context.reader);
  ASSIGN_OR_RETURN(const auto policies, store.policies());
  ASSIGN_OR_RETURN(const auto space, store.space());
  pb::Reply reply;
  auto* retention = reply.mutable_retention();
  for (const auto& policy : policies) *retention->add_policies() = policy;
  retention->set_database_bytes(space.database_bytes);
  retention->set_free_bytes(space.free_bytes);
  auto counts = context.reader.prepare(
      "SELECT recording, count(*) FROM sessions WHERE recording > 1 GROUP BY recording");
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, counts.step());
    if (!row) break;
    if (counts.integer(0) == 2) retention->set_thinned_sessions(counts.natural(1));
    if (counts.integer(0) == 3) retention->set_deleted_sessions(counts.natural(1));
  }
  ASSIGN_OR_RETURN(const auto last, MetaStore(context.reader).get("retention_unix_ns"));
  if (last) {
    std::int64_t value = 0;
    std::from_chars(last->data(), last->data() + last->size(), value);
    retention->set_last_run_unix_ns(value);
  }
  return reply;
}

Result<pb::Reply> setRetention(const Context& context, const pb::SetRetention& call) {
  pb::RetentionPolicy policy = call.policy();
  policy.set_by(context.who.name);
  policy.set_changed_unix_ns(context.now_unix_ns);
  const std::string subject = policy.exercise_id().empty() ? "(default)" : policy.exercise_id();
  RETURN_IF_ERROR(write(
      context, subject, call.as_default() ? "as the default" : textOfPolicy(policy), [&](Connection& writer) {
        RetentionStore store(writer);
        if (call.as_default()) return store.removePolicy(policy.exercise_id());
        // check in the policy's own transaction, before storing it makes the name known
        auto known = store.checkExercise(policy.exercise_id(), "retention policy, exercise_id");
        return known ? store.setPolicy(policy) : known;
      }));
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

Result<pb::Reply> runRetentionNow(const ServiceParts& parts, const Principal& who,
                                  const pb::RunRetention& call, RequestUnderWay& /*under_way*/) {
  ASSIGN_OR_RETURN(auto report, parts.retention.runOnRequest(who.doer(), call.dry_run()));
  pb::Reply reply;
  *reply.mutable_retention_report() = std::move(report);
  return reply;
}

}  // namespace needlelab::handlers
