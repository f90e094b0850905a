#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "common/base/clock.h"
#include "common/base/local_time.h"
#include "common/base/uuid.h"
#include "db/audit_chain.h"
#include "db/audit_head.h"
#include "db/encrypted_backup.h"
#include "db/service/audit_anchor.h"
#include "db/service/bootstrap.h"
#include "db/service/restore.h"

namespace needlelab {
namespace {

/// What a backup's place means for the spools; a server of before 1.4 does not say.
std::string placeText(const pb::BackupDone& done) {
  const std::string disk = done.disk() == pb::BackupDone::ANOTHER_DISK ? "on another disk than the database"
                           : done.disk() == pb::BackupDone::SAME_DISK  ? "on the same disk as the database"
                                                                       : "on a disk that is not known";
  if (done.safe()) return disk + ": what it contains is Safe, stations let it go";
  return disk +
         ": not Safe, stations keep what it contains (--counts-as-safe: although a fault may take both)";
}

/// `keep` > 0: `path` is a folder.
Status backup(CommandContext& context, const std::string& path, std::uint32_t keep, bool counts_as_safe) {
  std::filesystem::path target = path;
  if (context.backend.local()) {
    target = std::filesystem::absolute(target);
  } else if (!target.is_absolute()) {
    return Error{ErrorCode::kInvalidInput,
                 "backup: '" + path + "': give an absolute path, it is one of the server's machine"};
  }
  pb::Request request;
  request.mutable_backup()->set_path(target.string());
  request.mutable_backup()->set_keep(keep);
  request.mutable_backup()->set_counts_as_safe(counts_as_safe);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& done = reply.backup_done();
  const Json row = {{"path", done.path()},
                    {"bytes", done.bytes()},
                    {"chunks_verified", done.chunks_verified()},
                    {"undecodable_chunks", done.undecodable_chunks()},
                    {"disk", pb::BackupDone::Disk_Name(done.disk())},
                    {"safe", done.safe()},
                    {"encrypted", done.encrypted()},
                    {"place", placeText(done)},
                    {"removed", std::vector<std::string>(done.removed().begin(), done.removed().end())}};
  if (auto shown = context.output.one({{"path", "backup"},
                                       {"bytes", "size", Column::Kind::kBytes},
                                       {"chunks_verified", "chunks verified in the copy"},
                                       {"encrypted", "encrypted"},
                                       {"place", "place"}},
                                      row);
      !shown)
    return shown;
  if (done.undecodable_chunks() > 0)
    context.output.remark(
        fmt::format("{} chunks cannot be decoded: the backup has them as they came, but they are not Safe, "
                    "and their stations "
                    "keep them (needlelab-admin check names them)",
                    done.undecodable_chunks()));
  for (const std::string& old : done.removed()) context.output.text("removed the old backup " + oneLine(old));
  return {};
}

Status newBackupKey(Output& output, const std::string& file) {
  ASSIGN_OR_RETURN(const auto key, BackupKey::make(file));
  RETURN_IF_ERROR(
      output.one({{"file", "backup key"}, {"id", "its id"}}, {{"file", file}, {"id", key.idText()}}));
  output.text(
      "Keep a copy of it apart from the server and from the backups, e.g. on paper in a safe: without it "
      "nobody "
      "can read a backup that it encrypts.");
  return {};
}

Status restore(const std::filesystem::path& folder, Output& output, const std::string& from,
               const std::string& key) {
  ASSIGN_OR_RETURN(const auto result, restoreFrom(folder, from, wallNowNs(), nullptr, key));
  // open it once, to check that it opens, and to write the audit log
  Store::Options options;
  options.holder = "needlelab-admin";
  options.create = false;
  ASSIGN_OR_RETURN(auto store, Store::open(folder, options));
  Json again = Json::array();
  for (const RestoredAccess& one : result.valid_again)
    again.push_back({{"kind", one.station ? "station" : "user"}, {"name", one.name}, {"text", one.text}});
  const std::string kept = result.kept.empty() ? "none" : result.kept.string();
  if (auto noted = store->service().note("local", "restore", from, "replaced database kept as " + kept);
      !noted)
    return noted;
  if (auto shown = output.one({{"from", "restored from"},
                               {"sessions", "sessions checked"},
                               {"chunks", "chunks checked"},
                               {"kept", "replaced database kept as"},
                               {"erasures_repeated", "people erased anew"}},
                              {{"from", from},
                               {"sessions", result.sessions},
                               {"chunks", result.chunks},
                               {"kept", kept},
                               {"erasures_repeated", store->erasuresRepeated()},
                               {"valid_again", again},
                               {"not_compared", result.not_compared}});
      !shown)
    return shown;
  ASSIGN_OR_RETURN(const auto repeat, store->service().erasuresToRepeat());
  for (const std::string& erasure : repeat) output.remark(erasure);
  output.text(
      "Start the server: stations send again what this backup lacks and their spools have. Stations, people "
      "and "
      "profiles added after the backup have to be added again.");
  for (const RestoredAccess& one : result.valid_again) output.text("valid again: " + oneLine(one.text));
  if (!result.valid_again.empty())
    output.text("Withdraw them anew before anybody connects: user disable, user passwd, station revoke.");
  if (!result.not_compared.empty())
    output.text(
        "The replaced database cannot be read (" + oneLine(result.not_compared) +
        "): accounts and keys that were withdrawn after the backup are valid again; withdraw them anew.");
  if (!result.kept.empty()) output.text("Back to the replaced database: deploy/OPERATIONS.md, Restore.");
  return {};
}

Status check(CommandContext& context) {
  pb::Request request;
  request.mutable_check();
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& report = reply.check_report();
  Json row = {{"ok", report.ok()},
              {"sessions", report.sessions()},
              {"chunks", report.chunks()},
              {"faults", std::vector<std::string>(report.faults().begin(), report.faults().end())}};
  if (auto done = context.output.one({{"ok", "sound"}, {"sessions", "sessions"}, {"chunks", "chunks"}}, row);
      !done)
    return done;
  for (const std::string& fault : report.faults()) context.output.text("fault: " + oneLine(fault));
  if (!report.ok()) {
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("the database has faults ({} are listed): restore a backup; spools send what it lacks",
                    report.faults_size())};
  }
  return {};
}

/// The settings after `request`, which reads or changes them.
Status showLab(CommandContext& context, const pb::Request& request) {
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  return context.output.one({{"codes", "codes of trainees"}},
                            {{"codes", reply.lab_settings().codes_required() ? "required" : "optional"}});
}

/// The detail; of an imported line also where it comes from.
std::string shownDetail(const pb::AuditEntry& entry) {
  if (entry.imported_by().empty()) return entry.detail();
  return entry.detail() + (entry.detail().empty() ? "" : " ") + "(imported by " + entry.imported_by() +
         " from " + entry.imported_from() + ")";
}

Status audit(CommandContext& context, std::uint32_t limit) {
  Json rows = Json::array();
  const auto done = eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        request.mutable_list_audit()->set_limit(limit == 0 ? 0
                                                           : limit - static_cast<std::uint32_t>(rows.size()));
        request.mutable_list_audit()->set_page(page);
      },
      [&](const pb::Reply& reply) {
        for (const auto& entry : reply.audit().entries()) {
          rows.push_back({{"id", entry.id()},
                          {"unix_ns", entry.unix_ns()},
                          {"who", entry.who()},
                          {"action", entry.action()},
                          {"subject", entry.subject()},
                          {"detail", entry.detail()},
                          {"imported_by", entry.imported_by()},
                          {"imported_from", entry.imported_from()},
                          {"shown", shownDetail(entry)}});
        }
        return limit != 0 && rows.size() >= limit ? std::string() : reply.audit().next_page();
      });
  if (!done) return done;
  return context.output.list({{"id", "ID"},
                              {"unix_ns", "WHEN", Column::Kind::kTime},
                              {"who", "WHO"},
                              {"action", "ACTION"},
                              {"subject", "SUBJECT"},
                              {"shown", "DETAIL"}},
                             rows, "no changes yet");
}

/// What is right and still has to be said about the log: what nobody can check, and what a restore left
/// behind.
Result<std::vector<std::string>> notesOn(Connection& log, const AuditVerdict& verdict,
                                         const std::optional<KeptAuditHead>& kept) {
  const auto time = [&] { return localTime(kept->made_unix_ns, TimeForm::kZoned); };
  std::vector<std::string> notes;
  if (verdict.outside > 0)
    notes.push_back(
        fmt::format("{} lines were written before the chain began and cannot be checked", verdict.outside));
  if (verdict.earlier > 0)
    notes.push_back(fmt::format(
        "{} lines were written before the chain began{}: they are as they were then; what was done to them "
        "before cannot be checked",
        verdict.earlier, kept && kept->made_position == 0 ? " (" + time() + ")" : ""));
  if (!kept) {
    notes.push_back(fmt::format(
        "{} is not there: without it and without an anchor nobody can tell whether the last lines were "
        "removed, or an older database put in place; the next start makes it",
        kAuditHeadFile));
    return notes;
  }
  if (kept->replaced) {
    ASSIGN_OR_RETURN(const bool has, chainHas(log, *kept->replaced));
    if (!has)
      notes.push_back(
          fmt::format("a backup was restored ({}): the log had {} entries until then, and the backup {}; "
                      "what it lacks is "
                      "in the database that was replaced",
                      time(), kept->replaced->position, kept->made_position));
  } else if (kept->made_position > 0) {
    notes.push_back(
        fmt::format("{} was made on {}, when the log had {} entries: what was removed from its end before "
                    "shows with an anchor only",
                    kAuditHeadFile, time(), kept->made_position));
  }
  return notes;
}

/// Only reads, so it may run beside the server: whoever could have changed the log should not be asked
/// whether it did.
Status verifyLog(const std::filesystem::path& folder, Output& output,
                 const std::vector<std::string>& anchor_files, const std::vector<std::string>& key_files) {
  std::vector<AuditKey> keys;
  ASSIGN_OR_RETURN(auto key, AuditKey::ofFile(folder / kAuditKeyFile));
  keys.push_back(key);
  for (const std::string& file : key_files) {
    ASSIGN_OR_RETURN(key, AuditKey::ofFile(file));
    keys.push_back(key);
  }
  std::vector<AuditAnchor> anchors;
  for (const std::string& file : anchor_files) {
    ASSIGN_OR_RETURN(auto anchor, readAuditAnchor(file));
    anchors.push_back(std::move(anchor));
  }
  std::uint64_t anchored = 0;
  for (const AuditAnchor& anchor : anchors) anchored = std::max(anchored, anchor.head.position);
  // before the database is read: beside a server the log only grows
  std::optional<KeptAuditHead> kept;
  if (auto found = readKeptAuditHead(folder / kAuditHeadFile, keys)) {
    kept = *found;
    anchors.push_back({kAuditHeadFile, found->head});
  } else if (found.error().code != ErrorCode::kNotFound) {
    return found.error();
  }
  ASSIGN_OR_RETURN(auto reader,
                   Connection::open(folder / "needlelab.db", {.mode = Connection::Mode::kReader}));
  ASSIGN_OR_RETURN(const auto verdict, verifyAudit(reader, keys, anchors));
  ASSIGN_OR_RETURN(const auto notes, notesOn(reader, verdict, kept));
  RETURN_IF_ERROR(output.one({{"ok", "what is proven is as written"},
                              {"lines", "lines proven"},
                              {"earlier", "of these, older than their proof"},
                              {"outside", "lines that cannot be checked"},
                              {"anchored", "removal would show up to entry"},
                              {"head", "keep elsewhere"}},
                             {{"ok", verdict.ok()},
                              {"lines", verdict.lines},
                              {"earlier", verdict.earlier},
                              {"outside", verdict.outside},
                              {"anchored", anchored},
                              {"entries", verdict.head.position},
                              {"head", auditHeadText(verdict.head)},
                              {"notes", notes},
                              {"faults", verdict.texts}}));
  for (const std::string& text : notes) output.text("note: " + oneLine(text));
  for (const std::string& text : verdict.texts) output.text("fault: " + oneLine(text));
  if (!verdict.ok())
    return Error{ErrorCode::kCorrupt,
                 fmt::format("the audit log is not as it was written: {} faults ({} are listed)",
                             verdict.faults, verdict.texts.size())};
  if (anchored < verdict.head.position)
    output.text(
        fmt::format("Nothing is promised about lines that were removed behind entry {} by somebody who also "
                    "put audit.head back or has the key: give a later anchor, i.e. a backup, an export or a "
                    "head that was kept (--anchor)",
                    anchored));
  return {};
}

Json policyRow(const pb::RetentionPolicy& policy) {
  Json row = {{"exercise_id", policy.exercise_id().empty() ? Json() : Json(policy.exercise_id())},
              {"exercise", policy.exercise_id().empty() ? "(all others)" : policy.exercise_id()},
              {"thin_after_days", nullptr},
              {"thin_rate_hz", nullptr},
              {"thin_coarser", nullptr},
              {"delete_after_days", nullptr},
              {"without_backup", policy.without_backup()},
              {"by", policy.by()},
              {"changed_unix_ns", policy.changed_unix_ns()}};
  if (policy.has_thin_after_days()) {
    row["thin_after_days"] = policy.thin_after_days();
    row["thin_rate_hz"] = policy.thin_rate_hz();
    row["thin_coarser"] = policy.thin_coarser();
  }
  if (policy.has_delete_after_days()) row["delete_after_days"] = policy.delete_after_days();
  return row;
}

Status showRetention(CommandContext& context) {
  pb::Request request;
  request.mutable_list_retention();
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& retention = reply.retention();
  Json rows = Json::array();
  bool has_default = false;
  for (const auto& policy : retention.policies()) {
    rows.push_back(policyRow(policy));
    has_default = has_default || policy.exercise_id().empty();
  }
  if (auto done = context.output.list({{"exercise", "EXERCISE"},
                                       {"thin_after_days", "THIN_AFTER_DAYS"},
                                       {"thin_rate_hz", "TO_HZ"},
                                       {"thin_coarser", "COARSER"},
                                       {"delete_after_days", "DELETE_AFTER_DAYS"},
                                       {"without_backup", "WITHOUT_BACKUP"},
                                       {"by", "BY"},
                                       {"changed_unix_ns", "SINCE", Column::Kind::kTime}},
                                      rows, "no policy: every recording is kept for ever");
      !done)
    return done;
  if (!has_default && !rows.empty()) context.output.text("all other exercises: kept for ever");
  const std::string line = fmt::format(
      "{} sessions thinned, {} deleted; database {}, of it free for new recordings {}; last run {}",
      retention.thinned_sessions(), retention.deleted_sessions(), bytesText(retention.database_bytes()),
      bytesText(retention.free_bytes()), localTime(retention.last_run_unix_ns(), TimeForm::kZoned));
  context.output.done(line);
  return {};
}

const char* actionName(pb::RetentionStep::Action action) {
  switch (action) {
    case pb::RetentionStep::THIN:
      return "thin";
    case pb::RetentionStep::DELETE:
      return "delete";
    case pb::RetentionStep::WAITS_FOR_BACKUP:
      return "waits for a backup";
    case pb::RetentionStep::LEFT_ALONE:
      return "left alone";
    default:
      return "?";
  }
}

Status runNow(CommandContext& context, bool dry_run) {
  pb::Request request;
  request.mutable_run_retention()->set_dry_run(dry_run);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& report = reply.retention_report();
  Json rows = Json::array();
  for (const auto& step : report.steps()) {
    Uuid id{};
    if (step.session_id().size() == id.size())
      std::copy(step.session_id().begin(), step.session_id().end(), id.begin());
    rows.push_back({{"session_id", uuidText(id)},
                    {"exercise_id", step.exercise_id()},
                    {"action", actionName(step.action())},
                    {"bytes_before", step.bytes_before()},
                    {"bytes_after", dry_run ? Json() : Json(step.bytes_after())},
                    {"text", step.text()}});
  }
  if (auto done = context.output.list({{"session_id", "SESSION"},
                                       {"action", "ACTION"},
                                       {"bytes_before", "BEFORE", Column::Kind::kBytes},
                                       {"bytes_after", "AFTER", Column::Kind::kBytes},
                                       {"text", ""}},
                                      rows, "nothing is due");
      !done)
    return done;
  const bool cut = static_cast<std::uint64_t>(rows.size()) <
                   report.thinned() + report.deleted() + report.waiting_for_backup() + report.left_alone();
  context.output.done(fmt::format(
      "{}{} thinned, {} deleted, {} wait for a backup, {} left alone{}; {}{} of the database are free{}",
      dry_run ? "would be: " : "", report.thinned(), report.deleted(), report.waiting_for_backup(),
      report.left_alone(), cut ? fmt::format(" (the first {} are listed)", rows.size()) : "",
      dry_run ? "" : bytesText(report.bytes_before()) + " became " + bytesText(report.bytes_after()) + ", ",
      bytesText(report.free_bytes()),
      report.stopped() ? "; stopped by the server's end, the next run goes on" : ""));
  return {};
}

}  // namespace

void addUpkeepCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen) {
  struct Values {
    std::string path, folder, from, codes, key, encrypt_with;
    std::vector<std::string> anchors, keys;
    std::uint32_t limit = 100, keep = 14;
    bool counts_as_safe = false;
  };
  const auto values = std::make_shared<Values>();

  auto* backup_command =
      app.add_subcommand("backup", "copy the database to another file and verify the copy");
  auto* path = backup_command
                   ->add_option("path,--out", values->path,
                                "the new file; with --server a path of the server's machine")
                   ->type_name("FILE");
  auto* dir =
      backup_command
          ->add_option("--dir", values->folder,
                       "a folder in place of FILE: the file is named by the time, old ones are removed")
          ->type_name("DIR")
          ->excludes(path);
  backup_command->add_option("--keep", values->keep, "so many backups stay in DIR, the newest")
      ->check(CLI::Range(1u, 100'000u))
      ->capture_default_str()
      ->needs(dir);
  backup_command->add_flag("--counts-as-safe", values->counts_as_safe,
                           "stations let go of what this backup contains although it is not known to lie on "
                           "another disk than the database: one fault may then take both");
  backup_command
      ->add_option(
          "--encrypt-with", values->encrypt_with,
          "the file of a key (backup-key new); with --data only, a server has its own: --backup-key. "
          "Without it: $CREDENTIALS_DIRECTORY/backup.key, if there is one")
      ->type_name("KEYFILE");
  backup_command->callback([&chosen, &global, values] {
    chosen.check = [&chosen, &global, values]() -> Status {
      if (values->path.empty() && values->folder.empty())
        return Error{ErrorCode::kInvalidInput, "backup: give FILE, or --dir DIR [--keep N]"};
      // a server that runs takes the credential by itself
      chosen.encrypt_with = global.server.empty() ? backupKeyFile(values->encrypt_with)
                                                  : std::filesystem::path(values->encrypt_with);
      return {};
    };
    chosen.run = [values](CommandContext& context) {
      return values->folder.empty() ? backup(context, values->path, 0, values->counts_as_safe)
                                    : backup(context, values->folder, values->keep, values->counts_as_safe);
    };
  });

  auto* restore_command = app.add_subcommand(
      "restore", "put a backup in the place of a stopped server's database, which is kept (needs --data)");
  restore_command->add_option("--from", values->from, "the backup; it is checked completely first")
      ->required()
      ->type_name("FILE");
  restore_command
      ->add_option("--key", values->key,
                   "the key's file, for an encrypted backup; a plain one is refused then")
      ->type_name("KEYFILE");
  restore_command->callback([&chosen, values] {
    chosen.run_on_files = [values](const std::filesystem::path& folder, Output& output) {
      return restore(folder, output, values->from, values->key);
    };
  });

  auto* key_command = app.add_subcommand("backup-key", "the key that backups are encrypted with");
  key_command->require_subcommand(1);
  auto* new_key = key_command->add_subcommand("new", "make a random one; needs neither --data nor --server");
  new_key->add_option("file", values->key, "the new file; it is never overwritten")
      ->required()
      ->type_name("FILE");
  new_key->callback([&chosen, values] {
    chosen.run_alone = [values](Output& output) { return newBackupKey(output, values->key); };
  });

  auto* lab = app.add_subcommand("lab", "what holds for the whole lab");
  lab->require_subcommand(1);
  lab->add_subcommand("show", "whether trainees must have codes")->callback([&chosen] {
    chosen.run = [](CommandContext& context) {
      pb::Request request;
      request.mutable_get_lab_settings();
      return showLab(context, request);
    };
  });
  auto* lab_set = lab->add_subcommand("set", "change it");
  lab_set->add_option("--codes", values->codes, "required: who has no code cannot practise, except as guest")
      ->required()
      ->check(CLI::IsMember({"required", "optional"}));
  runs(lab_set, chosen, [values](CommandContext& context) {
    pb::Request request;
    request.mutable_change_lab_settings()->set_codes_required(values->codes == "required");
    return showLab(context, request);
  });

  app.add_subcommand("check", "read the whole database again: structure, every chunk, every hash")
      ->callback([&chosen] { chosen.run = check; });

  auto* audit_command = app.add_subcommand("audit", "who changed what, newest first");
  audit_command->add_option("--limit", values->limit, "at most so many; 0: all")->capture_default_str();
  audit_command->callback([&chosen, audit_command, values] {
    if (!audit_command->get_subcommands().empty()) return;
    chosen.run = [values](CommandContext& context) { return audit(context, values->limit); };
  });
  auto* verify = audit_command->add_subcommand(
      "verify",
      "whether lines were changed, reordered, put in or removed; also beside a server (needs --data)");
  verify
      ->add_option("--anchor", values->anchors,
                   "a backup, an export of everything, or a file with a head that was kept: what was removed "
                   "before it shows; may be repeated")
      ->type_name("FILE");
  verify->add_option("--key", values->keys, "an earlier audit.key; may be repeated")->type_name("FILE");
  verify->callback([&chosen, values] {
    chosen.run_on_files = [values](const std::filesystem::path& folder, Output& output) {
      return verifyLog(folder, output, values->anchors, values->keys);
    };
  });
}

// Retention: thinning and deletion of old recordings.

void addRetentionCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string exercise;
    bool is_default = false, keep = false, as_default = false, without_backup = false, dry_run = false;
    std::optional<std::uint32_t> thin_after, delete_after;
    double rate = 0, coarser = 0;
  };
  const auto values = std::make_shared<Values>();
  auto* retention =
      app.add_subcommand("retention", "what happens to recordings after a time; nothing, unless it is set");
  retention->require_subcommand(1);
  runs(retention->add_subcommand("show", "the policies, and what they have done"), chosen, showRetention);

  auto* run = retention->add_subcommand("run", "do now what is due; the server does it each day");
  run->add_flag("--dry-run", values->dry_run, "only say what would be done");
  runs(run, chosen, [values](CommandContext& context) { return runNow(context, values->dry_run); });

  auto* set = retention->add_subcommand("set", "the policy of an exercise, or of all others");
  set->add_option("exercise", values->exercise, "an exercise's id")->type_name("EXERCISE");
  set->add_flag("--default", values->is_default,
                "in place of EXERCISE: of all exercises without a policy of their own");
  set->add_flag("--keep", values->keep, "for ever");
  set->add_flag("--as-default", values->as_default, "no policy of its own any more");
  set->add_option("--thin-after", values->thin_after, "fewer samples so long after the session was closed")
      ->type_name("DAYS");
  set->add_option("--rate", values->rate, "samples a second that are left")->type_name("HZ");
  set->add_option("--coarser", values->coarser, "steps of the numbers: so many times the original's (1)")
      ->type_name("K");
  set->add_option("--delete-after", values->delete_after, "no samples so long after the session was closed")
      ->type_name("DAYS");
  set->add_flag("--without-backup", values->without_backup, "also sessions that no verified backup covers");
  set->callback([&chosen, values] {
    chosen.check = [values]() -> Status {
      const auto bad = [](const char* text) {
        return Error{ErrorCode::kInvalidInput, std::string("retention set: ") + text};
      };
      const Values& v = *values;
      if (v.exercise.empty() != v.is_default) return bad("give either an exercise's id or --default");
      const bool acts = v.thin_after || v.delete_after;
      if (v.keep + v.as_default + acts != 1)
        return bad("give --keep, --as-default, or one or both of --thin-after and --delete-after");
      if (v.thin_after.has_value() != (v.rate != 0)) return bad("--thin-after and --rate go together");
      if (v.coarser != 0 && !v.thin_after) return bad("--coarser goes with --thin-after");
      if (v.without_backup && !acts) return bad("--without-backup goes with --thin-after or --delete-after");
      return {};
    };
    chosen.run = [values](CommandContext& context) -> Status {
      const Values& v = *values;
      pb::Request request;
      auto* call = request.mutable_set_retention();
      call->set_as_default(v.as_default);
      auto* policy = call->mutable_policy();
      policy->set_exercise_id(v.exercise);
      if (v.thin_after) policy->set_thin_after_days(*v.thin_after);
      policy->set_thin_rate_hz(v.rate);
      policy->set_thin_coarser(v.coarser);
      if (v.delete_after) policy->set_delete_after_days(*v.delete_after);
      policy->set_without_backup(v.without_backup);
      RETURN_IF_ERROR(context.backend.call(request));
      context.output.done("set; `retention run --dry-run` says what it means now");
      return {};
    };
  });
}

}  // namespace needlelab
