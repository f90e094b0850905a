// The audit log: who changed what, and whether somebody changed the log.
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "common/base/local_time.h"
#include "db/audit_chain.h"
#include "db/audit_head.h"
#include "db/service/audit_anchor.h"

namespace needlelab {
namespace {

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

}  // namespace

void addAuditCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::vector<std::string> anchors, keys;
    std::uint32_t limit = 100;
  };
  const auto values = std::make_shared<Values>();
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

}  // namespace needlelab
