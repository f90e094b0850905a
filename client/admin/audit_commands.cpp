// The audit log: who changed what, and whether the log was tampered with.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/admin/backend.h"
#include "client/admin/command.h"
#include "common/base/time/clock.h"
#include "db/audit/audit_chain.h"
#include "db/audit/audit_head.h"
#include "db/service/records/record_end.h"
#include "db/service/start/bootstrap.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

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

/// Remarks on a log without faults: what cannot be checked, and what a restore left behind.
Result<std::vector<std::string>> notesOn(Connection& log, const std::optional<StoredAuditHead>& kept) {
  const auto time = [&] { return localTime(kept->made_unix_ns, TimeForm::kZoned); };
  std::vector<std::string> notes;
  if (!kept) {
    notes.push_back(
        fmt::format("{} does not exist: without it and without an anchor it is unknown whether the last "
                    "lines were removed, or an older database put in place; the next start makes it",
                    kAuditHeadFile));
    return notes;
  }
  if (kept->replaced) {
    ASSIGN_OR_RETURN(const bool has, chainHas(log, *kept->replaced));
    if (!has)
      notes.push_back(
          fmt::format("a backup was restored ({}): the log had {} entries until then, and the backup {}; "
                      "the missing ones are in the database that was replaced",
                      time(), kept->replaced->position, kept->made_position));
  } else if (kept->made_position > 0) {
    notes.push_back(
        fmt::format("{} was made on {}, when the log had {} entries: a removal from its end before that "
                    "shows only with an anchor",
                    kAuditHeadFile, time(), kept->made_position));
  }
  return notes;
}

std::string acknowledgedText(const AuditBreak& found) {
  return fmt::format("line {}: break of {}, acknowledged by {} on {}: {}", found.line,
                     localTime(found.unix_ns, TimeForm::kZoned), found.acknowledged_by,
                     localTime(found.acknowledged_unix_ns, TimeForm::kZoned), found.detail);
}

/// Adds the newest backup recorded in the database as an anchor, so that users need not name it. Returns why
/// it cannot be one; empty: it was added, or no backup exists yet.
Result<std::string> addNewestBackup(Connection& log, std::vector<AuditAnchor>& anchors) {
  ASSIGN_OR_RETURN(const auto path, MetaStore(log).get("backup_path"));
  if (!path) return std::string();
  auto anchor = readAuditAnchor(*path);
  if (!anchor) return "the newest backup is not an anchor here: " + anchor.error().message;
  anchors.push_back(std::move(*anchor));
  return std::string();
}

/// Only reads, so it may run beside the server, which might itself have changed the log and must not be the
/// one to verify it.
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
    ASSIGN_OR_RETURN(auto found, readAuditAnchors(file));
    std::move(found.begin(), found.end(), std::back_inserter(anchors));
  }
  // before the database is read: beside a running server the log only grows
  std::optional<StoredAuditHead> kept;
  if (auto found = readStoredAuditHead(folder / kAuditHeadFile, keys)) {
    kept = *found;
  } else if (found.error().code != ErrorCode::kNotFound) {
    return found.error();
  }
  ASSIGN_OR_RETURN(const auto address, addressOf(folder, ""));
  auto opened = openAt(address, Connection::Mode::kReader);
  if (!opened) return wrongStore(opened.error());
  Connection& reader = *opened;
  std::string no_backup;
  if (anchor_files.empty()) {
    ASSIGN_OR_RETURN(no_backup, addNewestBackup(reader, anchors));
  }
  std::uint64_t anchored = 0;
  for (const AuditAnchor& anchor : anchors) anchored = std::max(anchored, anchor.head.position);
  if (kept) anchors.push_back({kAuditHeadFile, kept->head});
  ASSIGN_OR_RETURN(const auto verdict, verifyAudit(reader, keys, anchors));
  ASSIGN_OR_RETURN(auto notes, notesOn(reader, kept));
  if (!no_backup.empty()) notes.push_back(no_backup);
  Json breaks = Json::array();
  bool all_acknowledged = true;
  for (const AuditBreak& found : verdict.breaks) {
    const bool acknowledged = !found.acknowledged_by.empty();
    all_acknowledged = all_acknowledged && acknowledged;
    if (acknowledged) notes.push_back(acknowledgedText(found));
    breaks.push_back({{"line", found.line},
                      {"unix_ns", found.unix_ns},
                      {"acknowledged_by", acknowledged ? Json(found.acknowledged_by) : Json()},
                      {"acknowledged_unix_ns", acknowledged ? Json(found.acknowledged_unix_ns) : Json()}});
  }
  RETURN_IF_ERROR(output.one({{"ok", "what is proven is as written"},
                              {"lines", "lines proven"},
                              {"anchored", "removal would show up to entry"},
                              {"head", "keep elsewhere"}},
                             {{"ok", verdict.ok()},
                              {"lines", verdict.lines},
                              {"anchored", anchored},
                              {"entries", verdict.head.position},
                              {"head", auditHeadText(verdict.head)},
                              {"breaks", breaks},
                              {"notes", notes},
                              {"faults", verdict.texts}}));
  for (const std::string& text : notes) output.text("note: " + oneLine(text));
  for (const std::string& text : verdict.texts) output.text("fault: " + oneLine(text));
  if (!all_acknowledged)
    output.text(
        "An \"audit break\" is a fault until somebody has found out who did what: then `audit acknowledge "
        "LINE`, on the stopped server's folder");
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

/// Opens the folder as the server does, so that a newly found break gets its line and remains a fault.
Status acknowledge(const std::filesystem::path& folder, Output& output, std::int64_t line) {
  Store::Options options;
  options.holder = "needlelab-admin";
  options.create = false;
  ASSIGN_OR_RETURN(const auto store, Store::open(folder, options));
  ASSIGN_OR_RETURN(const auto key, AuditKey::ofFile(folder / kAuditKeyFile));
  std::vector<AuditBreak> breaks;
  {
    ASSIGN_OR_RETURN(auto reader, store->readers().borrow());
    ASSIGN_OR_RETURN(auto verdict, verifyAudit(*reader, std::vector{key}, {}));
    breaks = std::move(verdict.breaks);
  }
  std::string open;
  const AuditBreak* chosen = nullptr;
  for (const AuditBreak& found : breaks) {
    if (found.line == line) chosen = &found;
    if (found.acknowledged_by.empty()) open += (open.empty() ? "" : ", ") + std::to_string(found.line);
  }
  if (chosen == nullptr)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("line {} of the audit log is not an \"{}\" of this log; {}", line, kAuditBreak,
                             open.empty() ? "there is nothing to acknowledge" : "there are: " + open)};
  if (!chosen->acknowledged_by.empty()) return Error{ErrorCode::kAlreadyExists, acknowledgedText(*chosen)};
  RETURN_IF_ERROR(store->service().notes().note(localName(), kAuditAcknowledge, acknowledgedSubject(line),
                                                auditHeadText(chosen->entry)));
  output.done(fmt::format("acknowledged: line {}, {}", line, chosen->detail));
  return {};
}

}  // namespace

void addAuditCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::vector<std::string> anchors, keys;
    std::uint32_t limit = 100;
    std::int64_t line = 0;
  };
  const auto values = std::make_shared<Values>();
  auto* audit_command = app.add_subcommand("audit", "list who changed what, newest first");
  audit_command->add_option("--limit", values->limit, "the most to list; 0: all")->capture_default_str();
  audit_command->callback([&chosen, audit_command, values] {
    if (!audit_command->get_subcommands().empty()) return;
    chosen.run = [values](CommandContext& context) { return audit(context, values->limit); };
  });
  auto* verify = audit_command->add_subcommand(
      "verify",
      "check that no line was changed, moved, added or removed; works beside a running server (needs --data)");
  verify
      ->add_option("--anchor", values->anchors,
                   "a backup, a folder of backups, an export of everything, or a file with a head that was "
                   "kept: a removal before it shows; may be repeated. Default: the newest backup, if "
                   "it is where it was made")
      ->type_name("FILE|DIR");
  verify->add_option("--key", values->keys, "an earlier audit.key; may be repeated")->type_name("FILE");
  verify->callback([&chosen, values] {
    chosen.run_on_files = [values](const std::filesystem::path& folder, Output& output) {
      return verifyLog(folder, output, values->anchors, values->keys);
    };
  });

  auto* acknowledged = audit_command->add_subcommand(
      "acknowledge",
      "mark an \"audit break\" as looked into: verify then lists it, with your name, as a note "
      "(needs --data)");
  acknowledged->add_option("line", values->line, "the line's number, as verify shows it")
      ->required()
      ->check(CLI::PositiveNumber);
  acknowledged->callback([&chosen, values] {
    chosen.run_on_files = [values](const std::filesystem::path& folder, Output& output) {
      return acknowledge(folder, output, values->line);
    };
  });
}

}  // namespace needlelab
