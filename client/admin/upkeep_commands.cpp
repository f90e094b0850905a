#include <filesystem>
#include <memory>

#include "admin/command.h"

namespace needlelab {
namespace {

Status backup(CommandContext& context, const std::string& path) {
  std::filesystem::path target = path;
  if (context.backend.local()) {
    target = std::filesystem::absolute(target);
  } else if (!target.is_absolute()) {
    return Error{ErrorCode::kInvalidInput,
                 "backup: '" + path + "': give an absolute path, it is one of the server's machine"};
  }
  pb::Request request;
  request.mutable_backup()->set_path(target.string());
  const auto reply = context.backend.call(request);
  if (!reply) return reply.error();
  const auto& done = reply->backup_done();
  const Json row = {
      {"path", done.path()}, {"bytes", done.bytes()}, {"chunks_verified", done.chunks_verified()}};
  return context.output.one({{"path", "backup"},
                             {"bytes", "size", Column::Kind::kBytes},
                             {"chunks_verified", "chunks verified in the copy"}},
                            row);
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
  pb::Request request;
  request.mutable_list_audit()->set_limit(limit);
  const auto reply = context.backend.call(request);
  if (!reply) return reply.error();
  Json rows = Json::array();
  for (const auto& entry : reply->audit().entries()) {
    rows.push_back({{"id", entry.id()},
                    {"unix_ns", entry.unix_ns()},
                    {"who", entry.who()},
                    {"action", entry.action()},
                    {"subject", entry.subject()},
                    {"detail", entry.detail()}});
  }
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
    std::string path;
    std::uint32_t limit = 100;
  };
  const auto values = std::make_shared<Values>();

  auto* backup_command =
      app.add_subcommand("backup", "copy the database to another file and verify the copy");
  backup_command
      ->add_option("path,--out", values->path, "the new file; with --server a path of the server's machine")
      ->required()
      ->type_name("FILE");
  backup_command->callback([&chosen, values] {
    chosen.run = [values](CommandContext& context) { return backup(context, values->path); };
  });

  app.add_subcommand("check", "read the whole database again: structure, every chunk, every hash")
      ->callback([&chosen] { chosen.run = check; });

  auto* audit_command = app.add_subcommand("audit", "who changed what, newest first");
  audit_command->add_option("--limit", values->limit, "at most so many")
      ->check(CLI::Range(1u, 1000u))
      ->capture_default_str();
  audit_command->callback([&chosen, values] {
    chosen.run = [values](CommandContext& context) { return audit(context, values->limit); };
  });
}

}  // namespace needlelab
