// Backups and restores, the lab's settings, the check of the database.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "common/base/time/clock.h"
#include "db/backup/check.h"
#include "db/backup/encrypted_backup.h"
#include "db/service/folder/data_folder.h"
#include "db/service/start/bootstrap.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

/// What a backup's location means for the spools.
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

/// Registers a backup of PostgreSQL, made by its own tools and restored at `url`.
Status backupVerified(CommandContext& context, const std::string& url, bool counts_as_safe) {
  pb::Request request;
  request.mutable_backup()->set_path(url);
  request.mutable_backup()->set_counts_as_safe(counts_as_safe);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& done = reply.backup_done();
  RETURN_IF_ERROR(context.output.one(
      {{"restored", "restored"}, {"chunks_verified", "chunks verified in it"}, {"safe", "Safe"}},
      {{"restored", done.path()},
       {"chunks_verified", done.chunks_verified()},
       {"undecodable_chunks", done.undecodable_chunks()},
       {"safe", done.safe()}}));
  if (done.undecodable_chunks() > 0)
    context.output.remark(
        fmt::format("{} chunks cannot be decoded: the backup has them as they came, but "
                    "they are not Safe, and their stations keep them",
                    done.undecodable_chunks()));
  if (!done.safe())
    context.output.remark(
        "nothing became Safe: the server does not see where the backup lies. If it is on another disk than "
        "the database: --counts-as-safe");
  return {};
}

Status newBackupKey(Output& output, const std::string& file) {
  ASSIGN_OR_RETURN(const auto key, BackupKey::make(file));
  RETURN_IF_ERROR(
      output.one({{"file", "backup key"}, {"id", "its id"}}, {{"file", file}, {"id", key.idText()}}));
  output.text(
      "Keep a copy of it apart from the server and from the backups, e.g. on paper in a safe: without it a "
      "backup that it encrypts cannot be read.");
  return {};
}

Status restore(const std::filesystem::path& folder, Output& output, const std::string& from,
               const std::string& key) {
  ASSIGN_OR_RETURN(const auto result, restoreFrom(folder, from, wallNowNs(), key));
  // open it once, to check that it opens, and to write the audit log
  Store::Options options;
  options.holder = "needlelab-admin";
  options.create = false;
  ASSIGN_OR_RETURN(auto store, Store::open(folder, options));
  const std::string kept = result.kept.empty() ? "none" : result.kept.string();
  Result<std::vector<RestoredAccess>> valid_again = std::vector<RestoredAccess>();
  if (!result.kept.empty()) valid_again = noteAccessValidAgain(*store, result.kept);
  RETURN_IF_ERROR(
      store->service().notes().note("local", "restore", from, "replaced database kept as " + kept));
  Json again = Json::array();
  if (valid_again)
    for (const RestoredAccess& one : *valid_again)
      again.push_back({{"kind", one.station ? "station" : "user"}, {"name", one.name}, {"text", one.text}});
  const std::string not_compared = valid_again ? "" : valid_again.error().message;
  if (auto shown = output.one({{"from", "restored from"},
                               {"sessions", "sessions checked"},
                               {"chunks", "chunks checked"},
                               {"kept", "replaced database kept as"},
                               {"erasures_repeated", "people erased again"}},
                              {{"from", from},
                               {"sessions", result.sessions},
                               {"chunks", result.chunks},
                               {"kept", kept},
                               {"erasures_repeated", store->erasuresRepeated()},
                               {"valid_again", again},
                               {"not_compared", not_compared}});
      !shown)
    return shown;
  output.text(
      "Start the server: stations send again what this backup lacks and their spools have. Stations, people "
      "and "
      "profiles added after the backup have to be added again.");
  for (const Json& one : again) output.text("valid again: " + oneLine(one["text"].get<std::string>()));
  if (!again.empty())
    output.text("Withdraw them again before anybody connects: user disable, user passwd, station revoke.");
  if (!not_compared.empty())
    output.text(
        "The replaced database cannot be read (" + oneLine(not_compared) +
        "): accounts and keys that were withdrawn after the backup are valid again; withdraw them again.");
  if (!result.kept.empty()) output.text("Back to the replaced database: OPERATIONS.md, Restore.");
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

/// Checks only that the database is an intact copy. Only damage to the copy is a fault; what the lab's own
/// database may have as well (undecodable chunks, wrong sums) is listed, and files beside it are ignored.
/// Changes nothing, not even the latest known time.
Status checkOfCopy(const std::filesystem::path& folder, Output& output) {
  ASSIGN_OR_RETURN(const auto address, addressOf(folder, ""));
  std::error_code error;
  if (!address.isPostgres() && !std::filesystem::exists(address.path, error))
    return Error{ErrorCode::kInvalidInput, folder.string() + ": there is no needlelab.db here, and no file " +
                                               kStoreFile + " that says where the database is"};
  ASSIGN_OR_RETURN(auto copy, openAt(address, Connection::Mode::kReader));
  RETURN_IF_ERROR(requireNewestSchema(copy));
  ASSIGN_OR_RETURN(const auto checked, checkDatabase(copy));
  std::vector<std::string> notes = checked.undecodable;
  notes.insert(notes.end(), checked.sums.begin(), checked.sums.end());
  RETURN_IF_ERROR(output.one({{"ok", "sound as a copy"}, {"sessions", "sessions"}, {"chunks", "chunks"}},
                             {{"ok", checked.ok()},
                              {"sessions", checked.sessions},
                              {"chunks", checked.chunks},
                              {"undecodable_chunks", checked.undecodable_chunks},
                              {"faults", checked.faults},
                              {"notes", notes}}));
  for (const std::string& fault : checked.faults) output.text("fault: " + oneLine(fault));
  for (const std::string& one : notes) output.text("as in its original: " + oneLine(one));
  if (checked.ok()) return {};
  return Error{ErrorCode::kCorrupt, fmt::format("the copy has faults ({} are listed): it is worth nothing",
                                                checked.faults.size())};
}

/// Shows the settings after `request`, which reads or changes them.
Status showLab(CommandContext& context, const pb::Request& request) {
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const pb::LabSettings& lab = reply.lab_settings();
  return context.output.one(
      {{"codes", "codes of trainees"}, {"sessions_of_erased", "sessions of erased people"}},
      {{"codes", lab.codes_required() ? "required" : "optional"},
       {"sessions_of_erased", lab.keep_recordings_of_erased() ? "stay, without a name" : "are erased, too"}});
}

}  // namespace

void addUpkeepCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen) {
  struct Values {
    std::string path, folder, from, codes, of_erased, key, encrypt_with, restored;
    std::uint32_t keep = 14;
    bool counts_as_safe = false;
  };
  const auto values = std::make_shared<Values>();

  auto* backup_command =
      app.add_subcommand("backup", "copy the database to another file and verify the copy");
  auto* path = backup_command
                   ->add_option("path,--out", values->path,
                                "the new file; with --server a path on the server's machine")
                   ->type_name("FILE");
  auto* dir =
      backup_command
          ->add_option("--dir", values->folder,
                       "a folder instead of FILE: the file is named by its time, and old ones are removed")
          ->type_name("DIR")
          ->excludes(path);
  backup_command->add_option("--keep", values->keep, "how many backups to keep in DIR")
      ->check(CLI::Range(1u, 100'000u))
      ->capture_default_str()
      ->needs(dir);
  backup_command->add_flag("--counts-as-safe", values->counts_as_safe,
                           "stations delete what this backup contains although it may be on the same disk as "
                           "the database: one fault may then take both");
  backup_command
      ->add_option(
          "--encrypt-with", values->encrypt_with,
          "the file of a key (backup-key new); with --data only, a server has its own: --backup-key. "
          "Without it: $CREDENTIALS_DIRECTORY/backup.key, if there is one")
      ->type_name("KEYFILE");
  auto* verified = backup_command->add_subcommand(
      "verified", "a database on PostgreSQL: compare a backup that was restored with the lab's database");
  verified
      ->add_option("--restored", values->restored,
                   "the address of the database that it was restored into; with --server as that machine "
                   "reaches it")
      ->required()
      ->type_name("URL");
  verified->add_flag("--counts-as-safe", values->counts_as_safe,
                     "the backup lies on another disk than the database: stations delete what it contains");
  runs(verified, chosen, [values](CommandContext& context) {
    return backupVerified(context, values->restored, values->counts_as_safe);
  });
  backup_command->callback([&chosen, &global, values, verified] {
    if (verified->parsed()) return;
    chosen.check = [&chosen, &global, values]() -> Status {
      if (values->path.empty() && values->folder.empty())
        return Error{ErrorCode::kInvalidInput, "backup: give FILE, or --dir DIR [--keep N]"};
      // a running server finds the credential itself
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
      "restore", "replace a stopped server's database by a backup; the old one is kept (needs --data)");
  restore_command->add_option("--from", values->from, "the backup; it is checked completely first")
      ->required()
      ->type_name("FILE");
  restore_command->add_option("--key", values->key, "the key's file, for an encrypted backup")
      ->type_name("KEYFILE");
  restore_command->callback([&chosen, values] {
    chosen.run_on_files = [values](const std::filesystem::path& folder, Output& output) {
      return restore(folder, output, values->from, values->key);
    };
  });

  auto* key_command = app.add_subcommand("backup-key", "the key that encrypts backups");
  key_command->require_subcommand(1);
  auto* new_key = key_command->add_subcommand("new", "make a random key; needs neither --data nor --server");
  new_key->add_option("file", values->key, "the new file; it is never overwritten")
      ->required()
      ->type_name("FILE");
  new_key->callback([&chosen, values] {
    chosen.run_without_folder = [values](Output& output) { return newBackupKey(output, values->key); };
  });

  auto* lab = app.add_subcommand("lab", "settings of the whole lab");
  lab->require_subcommand(1);
  lab->add_subcommand("show", "show the settings")->callback([&chosen] {
    chosen.run = [](CommandContext& context) {
      pb::Request request;
      request.mutable_get_lab_settings();
      return showLab(context, request);
    };
  });
  auto* lab_set = lab->add_subcommand("set", "change a setting");
  lab_set->add_option("--codes", values->codes, "required: people without a code can practise only as guest")
      ->check(CLI::IsMember({"required", "optional"}));
  lab_set
      ->add_option("--sessions-of-erased", values->of_erased,
                   "stay: an erased person's recordings stay, without a name")
      ->check(CLI::IsMember({"stay", "go"}));
  lab_set->require_option(1, 2);
  runs(lab_set, chosen, [values](CommandContext& context) {
    pb::Request request;
    auto* change = request.mutable_change_lab_settings();
    if (!values->codes.empty()) change->set_codes_required(values->codes == "required");
    if (!values->of_erased.empty()) change->set_keep_recordings_of_erased(values->of_erased == "stay");
    return showLab(context, request);
  });

  auto* check_command =
      app.add_subcommand("check", "check the whole database: structure, every chunk, every hash");
  const auto of_copy = std::make_shared<bool>(false);
  check_command->add_flag("--of-copy", *of_copy,
                          "only whether the database of --data is sound as a copy, such as a restored base "
                          "backup: chunks that cannot be decoded and wrong sums are named and are no fault, "
                          "and what lies beside it is not looked at; changes nothing");
  check_command->callback([&chosen, of_copy] {
    if (*of_copy)
      chosen.run_on_files = checkOfCopy;
    else
      chosen.run = check;
  });
}

}  // namespace needlelab
