#include <filesystem>
#include <memory>

#include "client/admin/command.h"
#include "common/base/clock.h"
#include "db/service/bootstrap.h"
#include "db/service/restore.h"

namespace needlelab {
namespace {

/// `keep` > 0: `path` is a folder.
Status backup(CommandContext& context, const std::string& path, std::uint32_t keep) {
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
  const auto reply = context.backend.call(request);
  if (!reply) return reply.error();
  const auto& done = reply->backup_done();
  const Json row = {{"path", done.path()},
                    {"bytes", done.bytes()},
                    {"chunks_verified", done.chunks_verified()},
                    {"removed", std::vector<std::string>(done.removed().begin(), done.removed().end())}};
  if (auto shown = context.output.one({{"path", "backup"},
                                       {"bytes", "size", Column::Kind::kBytes},
                                       {"chunks_verified", "chunks verified in the copy"}},
                                      row);
      !shown)
    return shown;
  for (const std::string& old : done.removed()) context.output.text("removed the old backup " + oneLine(old));
  return {};
}

Status restore(const std::filesystem::path& folder, Output& output, const std::string& from) {
  const auto result = restoreFrom(folder, from, wallNowNs());
  if (!result) return result.error();
  // opened once, so that it is known to open, and the audit log says what happened
  Store::Options options;
  options.holder = "needlelab-admin";
  options.create = false;
  auto store = Store::open(folder, options);
  if (!store) return store.error();
  Json again = Json::array();
  for (const RestoredAccess& one : result->valid_again)
    again.push_back({{"kind", one.station ? "station" : "user"}, {"name", one.name}, {"text", one.text}});
  const std::string kept = result->kept.empty() ? "none" : result->kept.string();
  if (auto noted = (*store)->service().note("local", "restore", from, "replaced database kept as " + kept);
      !noted)
    return noted;
  if (auto shown = output.one({{"from", "restored from"},
                               {"sessions", "sessions checked"},
                               {"chunks", "chunks checked"},
                               {"kept", "replaced database kept as"}},
                              {{"from", from},
                               {"sessions", result->sessions},
                               {"chunks", result->chunks},
                               {"kept", kept},
                               {"valid_again", again},
                               {"not_compared", result->not_compared}});
      !shown)
    return shown;
  const auto repeat = (*store)->service().erasuresToRepeat();
  if (!repeat) return repeat.error();
  for (const std::string& erasure : *repeat) output.remark(erasure);
  output.text(
      "Start the server: stations send again what this backup lacks and their spools have. Stations, people "
      "and "
      "profiles added after the backup have to be added again.");
  for (const RestoredAccess& one : result->valid_again) output.text("valid again: " + oneLine(one.text));
  if (!result->valid_again.empty())
    output.text("Withdraw them anew before anybody connects: user disable, user passwd, station revoke.");
  if (!result->not_compared.empty())
    output.text(
        "The replaced database cannot be read (" + oneLine(result->not_compared) +
        "): accounts and keys that were withdrawn after the backup are valid again; withdraw them anew.");
  if (!result->kept.empty()) output.text("Back to the replaced database: deploy/OPERATIONS.md, Restore.");
  return {};
}

Status check(CommandContext& context) {
  pb::Request request;
  request.mutable_check();
  const auto reply = context.backend.call(request);
  if (!reply) return reply.error();
  const auto& report = reply->check_report();
  Json row = {{"ok", report.ok()},
              {"sessions", report.sessions()},
              {"chunks", report.chunks()},
              {"faults", std::vector<std::string>(report.faults().begin(), report.faults().end())}};
  if (auto done = context.output.one({{"ok", "sound"}, {"sessions", "sessions"}, {"chunks", "chunks"}}, row);
      !done)
    return done;
  for (const std::string& fault : report.faults()) context.output.text("fault: " + oneLine(fault));
  if (!report.ok()) {
    return Error{ErrorCode::kCorrupt, "the database has faults (" + std::to_string(report.faults_size()) +
                                          " are listed): restore a backup; spools send what it lacks"};
  }
  return {};
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
                          {"detail", entry.detail()}});
        }
        return limit != 0 && rows.size() >= limit ? std::string() : reply.audit().next_page();
      });
  if (!done) return done;
  return context.output.list({{"id", "ID"},
                              {"unix_ns", "WHEN", Column::Kind::kTime},
                              {"who", "WHO"},
                              {"action", "ACTION"},
                              {"subject", "SUBJECT"},
                              {"detail", "DETAIL"}},
                             rows, "no changes yet");
}

}  // namespace

void addUpkeepCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string path, folder, from;
    std::uint32_t limit = 100, keep = 14;
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
  backup_command->callback([&chosen, values] {
    chosen.check = [values]() -> Status {
      if (values->path.empty() && values->folder.empty())
        return Error{ErrorCode::kInvalidInput, "backup: give FILE, or --dir DIR [--keep N]"};
      return {};
    };
    chosen.run = [values](CommandContext& context) {
      return values->folder.empty() ? backup(context, values->path, 0)
                                    : backup(context, values->folder, values->keep);
    };
  });

  auto* restore_command = app.add_subcommand(
      "restore", "put a backup in the place of a stopped server's database, which is kept (needs --data)");
  restore_command->add_option("--from", values->from, "the backup; it is checked completely first")
      ->required()
      ->type_name("FILE");
  restore_command->callback([&chosen, values] {
    chosen.run_on_files = [values](const std::filesystem::path& folder, Output& output) {
      return restore(folder, output, values->from);
    };
  });

  app.add_subcommand("check", "read the whole database again: structure, every chunk, every hash")
      ->callback([&chosen] { chosen.run = check; });

  auto* audit_command = app.add_subcommand("audit", "who changed what, newest first");
  audit_command->add_option("--limit", values->limit, "at most so many; 0: all")->capture_default_str();
  audit_command->callback([&chosen, values] {
    chosen.run = [values](CommandContext& context) { return audit(context, values->limit); };
  });
}

}  // namespace needlelab
