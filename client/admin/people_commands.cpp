#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include <algorithm>
#include <memory>

#include "client/admin/command.h"
#include "client/admin/session_export.h"
#include "common/base/files.h"
#include "common/base/secret.h"
#include "common/base/text.h"
#include "common/base/uuid.h"
#include "db/service/requests.h"

namespace needlelab {
namespace {

/// Parses trainee, instructor, curriculum-manager, administrator; also short forms and the protocol's names.
Result<pb::Role> parseRole(std::string text) {
  text = lowerCase(text);
  std::replace(text.begin(), text.end(), '_', '-');
  if (text == "admin") text = "administrator";
  if (text == "manager") text = "curriculum-manager";
  const pb::Role role = roleOfName(text);
  if (role == pb::ROLE_UNSPECIFIED || role == pb::STATION) {
    return Error{ErrorCode::kInvalidInput,
                 "--role: '" + text +
                     "', allowed are trainee, instructor, curriculum-manager, administrator, researcher"};
  }
  return role;
}

Result<std::string> newPassword(const std::string& name, const std::string& file) {
  return file.empty() ? askNewSecret("password", name, "--new-password-file") : passwordFromFile(file);
}

Status listUsers(CommandContext& context) {
  Json rows = Json::array();
  const auto done = eachPage(
      context.backend,
      [](pb::Request& request, const std::string& page) { request.mutable_list_users()->set_page(page); },
      [&](const pb::Reply& reply) {
        for (const auto& user : reply.users().users()) {
          std::string groups;
          for (const auto& group : user.groups()) groups += (groups.empty() ? "" : ", ") + group;
          rows.push_back({{"name", user.name()},
                          {"full_name", user.full_name()},
                          {"groups", groups},
                          {"consents", user.has_consent() ? (user.consent().given() ? "yes" : "no") : "-"},
                          {"revision", user.revision()},
                          {"role", roleName(user.role())},
                          {"disabled", user.disabled()},
                          {"has_password", user.has_password()},
                          {"has_code", user.has_code()},
                          {"created_unix_ns", user.created_unix_ns()}});
        }
        return reply.users().next_page();
      });
  if (!done) return done;
  return context.output.list({{"name", "NAME"},
                              {"full_name", "FULL NAME"},
                              {"role", "ROLE"},
                              {"groups", "GROUPS"},
                              {"consents", "CONSENTS"},
                              {"disabled", "DISABLED"},
                              {"has_password", "PASSWORD"},
                              {"has_code", "CODE"},
                              {"created_unix_ns", "SINCE", Column::Kind::kTime}},
                             rows, "nobody yet");
}

/// Imports a table of people; shows the outcome of each row and the errors.
Status importPeople(CommandContext& context, const std::string& file, const std::string& text, bool dry_run) {
  pb::Request request;
  request.mutable_import_people()->set_csv(text);
  request.mutable_import_people()->set_dry_run(dry_run);
  const auto reply = context.backend.call(request);
  if (!reply) return Error{reply.error().code, file + ": " + reply.error().message};
  const auto& report = reply->people_import();
  Json rows = Json::array();
  for (const auto& row : report.rows()) {
    rows.push_back({{"line", row.line()},
                    {"name", row.name()},
                    {"what", lowerCase(pb::PeopleImport::What_Name(row.what()))},
                    {"column", row.column()},
                    {"text", row.text()}});
  }
  if (auto done = context.output.list(
          {{"line", "LINE"}, {"name", "NAME"}, {"what", "WHAT"}, {"column", "COLUMN"}, {"text", "WHY"}}, rows,
          "no rows");
      !done)
    return done;
  if (report.faults() > 0)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: {} rows cannot be taken: nothing was changed", file, report.faults())};
  context.output.done(fmt::format("{}{} added, {} changed, {} as they were",
                                  report.done() ? "" : "a dry run: ", report.added(), report.changed(),
                                  report.unchanged()));
  return {};
}

/// Changes a person's current revision by the command's fields.
Status changeUser(CommandContext& context, pb::ChangeUser change) {
  pb::Request show;
  show.mutable_get_user()->set_name(change.name());
  ASSIGN_OR_RETURN(const auto now, context.backend.call(show));
  change.set_base_revision(now.user().revision());
  pb::Request request;
  *request.mutable_change_user() = change;
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  context.output.done(fmt::format("'{}' is revision {}", change.name(), reply.user().revision()));
  return {};
}

constexpr std::size_t kMostPieceBytes = 700'000;  // of records in one request, which must fit into 1 MiB
constexpr int kMostPieceRecords = 10'000;         // the server takes 20,000 (teaching.proto)
constexpr std::size_t kMostRecordsFile = 512u << 20;
constexpr std::size_t kMostPeopleFile = 900'000;

/// Writes pages of records as lines, to a file (atomically, readable only by its owner) or to the output.
Status writeRecords(CommandContext& context, const std::string& file,
                    const std::function<void(pb::Request&, const std::string&)>& ask,
                    const std::string& what) {
  std::string text;
  std::uint64_t count = 0;
  const auto done = eachPage(context.backend, ask, [&](const pb::Reply& reply) {
    for (const std::string& record : reply.records().records()) {
      text += record + "\n";
      ++count;
    }
    return reply.records().next_page();
  });
  if (!done) return done;
  if (file.empty()) {
    if (!text.empty()) text.pop_back();
    context.output.document(text);
    return {};
  }
  RETURN_IF_ERROR(writeFileAtomically(file, viewOf(text), 0600));
  context.output.done(fmt::format("wrote {} records of {} to {}", count, what, file));
  return {};
}

Status importAll(CommandContext& context, const std::string& file, const std::string& text, bool dry_run) {
  pb::Request request;
  auto* import_all = request.mutable_import_all();
  import_all->set_import_id(uuidText(makeUuidV7()));
  import_all->set_dry_run(dry_run);
  std::size_t bytes = 0;
  pb::ImportReport report;
  const auto send = [&](bool last) -> Status {
    import_all->set_last(last);
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    report = reply.import_report();
    import_all->clear_records();
    bytes = 0;
    return {};
  };
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    if ((bytes + (end - at) > kMostPieceBytes && bytes > 0) ||
        import_all->records_size() == kMostPieceRecords) {
      RETURN_IF_ERROR(send(false));
    }
    import_all->add_records(text.substr(at, end - at));
    bytes += end - at + 8;
    at = end + 1;
  }
  RETURN_IF_ERROR(send(true));
  Json rows = Json::array();
  for (const auto& count : report.counts())
    rows.push_back({{"kind", count.kind()},
                    {"added", count.added()},
                    {"unchanged", count.unchanged()},
                    {"faults", count.faults()}});
  if (auto done = context.output.list(
          {{"kind", "KIND"}, {"added", "ADDED"}, {"unchanged", "UNCHANGED"}, {"faults", "FAULTS"}}, rows,
          "no records");
      !done)
    return done;
  for (const auto& fault : report.faults())
    context.output.remark(oneLine(file + ": " + fault.path() + ": " + fault.message()));
  if (!report.faults().empty())
    return Error{ErrorCode::kInvalidInput, file + ": nothing was imported, see the faults above"};
  context.output.done(report.done() ? "imported" : "a dry run: nothing was changed");
  return {};
}

Status setCode(CommandContext& context, const std::string& name, const std::string& file, bool make,
               bool remove) {
  pb::Request request;
  auto* call = request.mutable_set_code();
  call->set_name(name);
  call->set_make(make);
  if (!make && !remove) {
    ASSIGN_OR_RETURN(const auto code, file.empty() ? askNewSecret("code", name, "--code-file")
                                                   : passwordFromFile(file, "code"));
    call->set_code(code);
  }
  const auto reply = context.backend.call(request);
  wipe(*call->mutable_code());
  if (!reply) return reply.error();
  if (!make) {
    context.output.done("code of '" + name + (remove ? "' removed" : "' set"));
    return {};
  }
  RETURN_IF_ERROR(context.output.oneSecret({{"name", "name"}, {"code", "code"}},
                                           {{"name", name}, {"code", reply->new_code().code()}}));
  context.output.text("shown this once: only its hash is kept");
  return {};
}

void addConsentCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string name, note;
  };
  const auto values = std::make_shared<Values>();
  auto* consent = app.add_subcommand("consent", "what people said to studies");
  consent->require_subcommand(1);
  for (const bool given : {true, false}) {
    auto* command =
        given ? consent->add_subcommand("give", "somebody consents to studies")
              : consent->add_subcommand("withdraw", "somebody does so no more: from now on in no export");
    command->add_option("name", values->name)->required();
    command->add_option("--note", values->note, "e.g. where the signed paper is");
    runs(command, chosen, [values, given](CommandContext& context) -> Status {
      pb::Request request;
      request.mutable_set_consent()->set_name(values->name);
      request.mutable_set_consent()->set_given(given);
      request.mutable_set_consent()->set_note(values->note);
      RETURN_IF_ERROR(context.backend.call(request));
      context.output.done("'" + values->name + (given ? "' consents" : "' consents no more"));
      return {};
    });
  }
  auto* list = consent->add_subcommand("list", "all that a person ever said");
  list->add_option("name", values->name)->required();
  runs(list, chosen, [values](CommandContext& context) -> Status {
    pb::Request request;
    request.mutable_list_consents()->set_name(values->name);
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    Json rows = Json::array();
    for (const auto& one : reply.consents().consents())
      rows.push_back(
          {{"given", one.given()},
           {"unix_ns", one.unix_ns()},
           {"recorded_by", one.recorded_by()},
           {"how", one.recorded_by() == values->name ? "by the person" : "on paper, by " + one.recorded_by()},
           {"note", one.note()}});
    return context.output.list(
        {{"unix_ns", "WHEN", Column::Kind::kTime}, {"given", "CONSENTS"}, {"how", "HOW"}, {"note", "NOTE"}},
        rows, "never asked");
  });
}

void addOnePersonCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string name, out, confirm, reason;
    bool with_open = false, with_waiting = false;
  };
  const auto values = std::make_shared<Values>();
  auto* person = app.add_subcommand("person", "all of a person's data");
  person->require_subcommand(1);
  auto* out = person->add_subcommand("export", "everything but recordings, as JSON lines");
  out->add_option("name", values->name)->required();
  out->add_option("--out", values->out, "default: standard output")->type_name("FILE");
  runs(out, chosen, [values](CommandContext& context) {
    return writeRecords(
        context, values->out,
        [&](pb::Request& request, const std::string& page) {
          request.mutable_export_person()->set_name(values->name);
          request.mutable_export_person()->set_page(page);
        },
        "'" + values->name + "'");
  });
  auto* erase = person->add_subcommand("erase", "erase a person's data for ever");
  erase->add_option("name", values->name)->required();
  erase->add_option("--confirm", values->confirm, "the name again")->required()->type_name("NAME");
  erase->add_option("--reason", values->reason, "for the record of erasures");
  erase->add_flag("--with-open-sessions", values->with_open,
                  "sessions that are open, too: what is still sent is not kept");
  erase->add_flag("--with-waiting", values->with_waiting,
                  "sessions that wait for a manager under this name, too: they may be another person's");
  runs(erase, chosen, [values](CommandContext& context) -> Status {
    pb::Request request;
    auto* call = request.mutable_erase_person();
    call->set_name(values->name);
    call->set_confirm(values->confirm);
    call->set_reason(values->reason);
    call->set_with_open_sessions(values->with_open);
    call->set_with_waiting_sessions(values->with_waiting);
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    const auto& erasure = reply.erasure();
    if (auto done = context.output.one(
            {{"pseudonym", "known as"},
             {"sessions", "sessions"},
             {"recordings", "recordings removed"},
             {"scores", "scores removed"},
             {"remarks_kept", "remarks by others kept, without the name"},
             {"audit_lines", "lines of the audit log with the name replaced"},
             {"waiting_sessions", "sessions that wait under the name, left"},
             {"state", "the erasure"}},
            {{"pseudonym", erasure.pseudonym()},
             {"sessions", erasure.sessions()},
             {"recordings", erasure.recordings()},
             {"scores", erasure.scores()},
             {"remarks_kept", erasure.remarks_kept()},
             {"audit_lines", erasure.audit_lines()},
             {"waiting_sessions", erasure.waiting_sessions()},
             {"state", erasure.pending() ? "pending: see below" : "complete here"},
             {"pending", erasure.pending()},
             {"files", std::vector<std::string>(erasure.files().begin(), erasure.files().end())},
             {"text", erasure.text()}});
        !done)
      return done;
    context.output.remark(erasure.text());
    return {};
  });
}

}  // namespace

void addUserCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen) {
  auto* user = app.add_subcommand("user", "people and their roles");
  user->require_subcommand(1);

  struct Values {
    std::string name, role, full_name, file, text;
    bool dry_run = false, make = false, remove = false;
  };
  const auto values = std::make_shared<Values>();
  const auto add_password_options = [&chosen](CLI::App* command) {
    command
        ->add_option("--password-file,--new-password-file", chosen.new_password_file,
                     "first line: the new password; else it is asked for")
        ->type_name("FILE");
  };

  auto* add = user->add_subcommand("add", "add a person; trainees may do without a password");
  add->add_option("name", values->name)->required();
  add->add_option("--role", values->role,
                  "trainee, instructor, curriculum-manager, administrator or researcher")
      ->required();
  add->add_option("--full-name", values->full_name, "as people call them");
  add_password_options(add);
  add->callback([&global, &chosen, values] {
    chosen.may_create = true;
    chosen.check = [values]() -> Status {
      RETURN_IF_ERROR(parseRole(values->role));
      return checkNewName("name", values->name);
    };
    chosen.run = [&global, &chosen, values](CommandContext& context) -> Status {
      const auto role = parseRole(values->role);
      // a folder needs no log-in: a file before the subcommand can only be the new password's
      std::string file = chosen.new_password_file;
      if (file.empty() && context.backend.local()) file = global.password_file;
      pb::Request request;
      request.mutable_add_user()->set_name(values->name);
      request.mutable_add_user()->set_role(*role);
      request.mutable_add_user()->set_full_name(values->full_name);
      if (*role != pb::TRAINEE || !file.empty()) {
        ASSIGN_OR_RETURN(const auto password, newPassword(values->name, file));
        request.mutable_add_user()->set_password(password);
      }
      RETURN_IF_ERROR(context.backend.call(request));
      context.output.done("added " + std::string(roleName(*role)) + " '" + values->name + "'");
      return {};
    };
  });

  auto* import_people = user->add_subcommand("import", "people from a table: all rows or none");
  import_people
      ->add_option("file", values->file,
                   "columns name, full_name, role, group, password, code; only name must be there")
      ->required()
      ->type_name("FILE.csv");
  import_people->add_flag("--dry-run", values->dry_run, "only say what would happen");
  import_people->callback([&chosen, values] {
    chosen.may_create = true;
    // a file that cannot be read makes no folder
    chosen.check = [values]() -> Status {
      ASSIGN_OR_RETURN(values->text, readWholeFile(values->file, kMostPeopleFile));
      return {};
    };
    chosen.run = [values](CommandContext& context) {
      return importPeople(context, values->file, values->text, values->dry_run);
    };
  });
  auto* change = user->add_subcommand("change", "another role or full name");
  change->add_option("name", values->name)->required();
  change->add_option("--role", values->role);
  auto* full_name = change->add_option("--full-name", values->full_name);
  runs(change, chosen, [values, full_name](CommandContext& context) -> Status {
    pb::ChangeUser wanted;
    wanted.set_name(values->name);
    if (!values->role.empty()) {
      ASSIGN_OR_RETURN(const auto role, parseRole(values->role));
      wanted.set_role(role);
    }
    if (full_name->count() > 0) wanted.set_full_name(values->full_name);
    return changeUser(context, wanted);
  });

  user->add_subcommand("list", "everybody")->callback([&chosen] { chosen.run = listUsers; });

  for (const bool enable : {false, true}) {
    auto* command = enable ? user->add_subcommand("enable", "undo a disable")
                           : user->add_subcommand("disable", "no more log-in; nothing is deleted");
    command->add_option("name", values->name)->required();
    runs(command, chosen, [values, enable](CommandContext& context) -> Status {
      pb::Request request;
      request.mutable_disable_user()->set_name(values->name);
      request.mutable_disable_user()->set_enable(enable);
      RETURN_IF_ERROR(context.backend.call(request));
      context.output.done((enable ? "enabled '" : "disabled '") + values->name + "'");
      return {};
    });
  }

  auto* passwd = user->add_subcommand("passwd", "set a password: one's own, or as administrator anybody's");
  passwd->add_option("name", values->name)->required();
  add_password_options(passwd);
  runs(passwd, chosen, [&global, &chosen, values](CommandContext& context) -> Status {
    std::string file = chosen.new_password_file;
    if (file.empty() && context.backend.local()) file = global.password_file;
    ASSIGN_OR_RETURN(const auto password, newPassword(values->name, file));
    pb::Request request;
    request.mutable_set_password()->set_name(values->name);
    request.mutable_set_password()->set_password(password);
    if (!context.backend.local() && values->name == context.global.user) {
      ASSIGN_OR_RETURN(*request.mutable_set_password()->mutable_old_password(),
                       global.password_file.empty()
                           ? askPassword("password of " + values->name + " until now", "--password-file")
                           : passwordFromFile(global.password_file));
    }
    RETURN_IF_ERROR(context.backend.call(request));
    context.output.done("password of '" + values->name + "' set");
    return {};
  });

  auto* code = user->add_subcommand("code", "the PIN or badge code that stations ask for before a lesson");
  code->add_option("name", values->name)->required();
  auto* make = code->add_flag("--make", values->make, "the server makes a PIN of six digits, shown once");
  auto* file = code->add_option("--code-file", values->file, "first line: the code; else it is asked for")
                   ->type_name("FILE");
  code->add_flag("--remove", values->remove, "no code any more")->excludes(make)->excludes(file);
  make->excludes(file);
  runs(code, chosen, [values](CommandContext& context) {
    return setCode(context, values->name, values->file, values->make, values->remove);
  });
}

// A person's data, consent, studies, and the export of all records.

void addPersonCommands(CLI::App& app, ChosenCommand& chosen) {
  addOnePersonCommands(app, chosen);
  addConsentCommands(app, chosen);
  struct Values {
    std::string study, out, exercise, file, text, session, format = "csv";
    bool remarks = false, setup = false, passwords = false, dry_run = false;
  };
  const auto values = std::make_shared<Values>();
  auto* study = app.add_subcommand("study", "for researchers: those who consent, under pseudonyms");
  study->require_subcommand(1);
  auto* out = study->add_subcommand("export", "sessions and scores as JSON lines");
  out->add_option("study", values->study,
                  "its name: pseudonyms are the same within it, and others in another")
      ->required();
  out->add_option("--out", values->out, "default: standard output")->type_name("FILE");
  out->add_option("--exercise", values->exercise, "default: all");
  out->add_flag("--with-remarks", values->remarks, "with what instructors wrote; names in it are replaced");
  out->add_flag("--with-setup", values->setup,
                "with device, placement and tool, by which stations can be told apart");
  runs(out, chosen, [values](CommandContext& context) {
    return writeRecords(
        context, values->out,
        [&](pb::Request& request, const std::string& page) {
          auto* call = request.mutable_export_study();
          call->set_with_setup(values->setup);
          call->set_study(values->study);
          call->set_exercise_id(values->exercise);
          call->set_with_remarks(values->remarks);
          call->set_page(page);
        },
        "study '" + values->study + "'");
  });
  auto* recording =
      study->add_subcommand("recording", "the samples of one of its sessions; times begin with 0");
  recording->add_option("study", values->study)->required();
  recording->add_option("session", values->session, "as study export names it")->required();
  recording->add_option("--format", values->format)->check(CLI::IsMember({"csv", "json", "recording"}));
  recording->add_option("--out", values->out)->required()->type_name("FILE");
  runs(recording, chosen, [values](CommandContext& context) {
    return exportStudyRecording(context.backend, context.output, values->study, values->session,
                                values->format, values->out);
  });
  auto* all = app.add_subcommand("export-all", "everything but recordings, as JSON lines");
  all->add_option("--out", values->out, "default: standard output")->type_name("FILE");
  all->add_flag("--with-passwords", values->passwords, "with the hashes of passwords and of stations' keys");
  runs(all, chosen, [values](CommandContext& context) {
    return writeRecords(
        context, values->out,
        [&](pb::Request& request, const std::string& page) {
          request.mutable_export_all()->set_with_passwords(values->passwords);
          request.mutable_export_all()->set_page(page);
        },
        "everything");
  });
  auto* import_all = app.add_subcommand("import-all", "read in what export-all wrote: all of it or nothing");
  import_all->add_option("file", values->file)->required()->type_name("FILE");
  import_all->add_flag("--dry-run", values->dry_run, "only say what would happen");
  import_all->callback([&chosen, values] {
    chosen.may_create = true;
    // a file that cannot be read makes no folder
    chosen.check = [values]() -> Status {
      ASSIGN_OR_RETURN(values->text, readWholeFile(values->file, kMostRecordsFile));
      return {};
    };
    chosen.run = [values](CommandContext& context) {
      return importAll(context, values->file, values->text, values->dry_run);
    };
  });
}  // namespace needlelab

}  // namespace needlelab
