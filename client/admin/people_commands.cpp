// People: accounts, roles, passwords, codes.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <string>

#include "client/admin/command.h"
#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "common/base/secret.h"
#include "common/base/text/csv_rows.h"
#include "common/base/text/text.h"
#include "db/people/person_name.h"
#include "db/service/context/principal.h"

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
  return file.empty() ? promptNewSecret("password", name, "--new-password-file") : passwordFromFile(file);
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
          if (user.more_groups() > 0) groups += fmt::format(" and {} more", user.more_groups());
          rows.push_back({{"name", user.name()},
                          {"id", user.id()},
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
                              {"id", "ID"},
                              {"created_unix_ns", "SINCE", Column::Kind::kTime}},
                             rows, "nobody yet");
}

constexpr std::size_t kMaxPeopleFile = 900'000;

/// Imports a table of people; shows the outcome of each row and the errors.
Status importPeople(CommandContext& context, const std::string& file, const std::string& text,
                    std::uint32_t lines_above, bool dry_run) {
  pb::Request request;
  request.mutable_import_people()->set_csv(text);
  request.mutable_import_people()->set_lines_above(lines_above);
  request.mutable_import_people()->set_dry_run(dry_run);
  const auto reply = context.backend.call(request);
  if (!reply) return Error{reply.error().code, file + ": " + reply.error().message};
  const auto& report = reply->people_import();
  Json rows = Json::array();
  std::string ignored;
  for (const auto& row : report.rows()) {
    if (row.what() == pb::PeopleImport::WHAT_UNSPECIFIED) {  // a column of the header
      if (row.name().empty()) ignored += (ignored.empty() ? "" : ", ") + row.column();
      continue;
    }
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
  if (!ignored.empty()) context.output.remark("ignored: " + ignored);
  if (report.rows_left_out() > 0)
    context.output.remark(fmt::format("{} more rows are not shown: {}", report.rows_left_out(),
                                      report.faults() > 0 ? "rows with faults come first"
                                                          : "none gives a role other than trainee, another "
                                                            "role, a password or a code"));
  if (report.faults() > 0)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: {} rows cannot be taken: nothing was changed", file, report.faults())};
  // repeat the summary: the first rows of a long table scroll away
  context.output.done(fmt::format(
      "{}{} added, {} changed, {} as they were{}", report.done() ? "" : "a dry run: ", report.added(),
      report.changed(), report.unchanged(),
      report.rights_given() == 0
          ? ""
          : fmt::format("; the first {} rows give a role, a password or a code", report.rights_given())));
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

Status setCode(CommandContext& context, const std::string& name, const std::string& file, bool make,
               bool remove) {
  pb::Request request;
  auto* call = request.mutable_set_code();
  call->set_name(name);
  call->set_make(make);
  if (!make && !remove) {
    ASSIGN_OR_RETURN(const auto code, file.empty() ? promptNewSecret("code", name, "--code-file")
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

}  // namespace

void addUserCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen) {
  auto* user = app.add_subcommand("user", "people and their roles");
  user->require_subcommand(1);

  struct Values {
    std::string name, role, full_name, file, text, encoding = "unicode";
    std::uint32_t lines_above = 0;
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
      values->name = trimmedName(values->name);
      return checkNewPersonName("name", values->name);
    };
    chosen.run = [&global, &chosen, values](CommandContext& context) -> Status {
      const auto role = parseRole(values->role);
      // a folder needs no log-in, so a file before the subcommand can only be for the new password
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
                   "columns name, full_name, role, group, password, code, or usual words for them; only the "
                   "account (name) must be there, others are ignored")
      ->required()
      ->type_name("FILE.csv");
  import_people
      ->add_option("--encoding", values->encoding,
                   "what the file is written in, unless it is UTF-8 or UTF-16: windows-1252")
      ->check(CLI::IsMember({"unicode", "windows-1252"}));
  import_people->add_option("--lines-above", values->lines_above, "lines above the header, 0 to 1000")
      ->check(CLI::Range(0, 1000));
  import_people->add_flag("--dry-run", values->dry_run, "only list what would happen");
  import_people->callback([&chosen, values] {
    chosen.may_create = true;
    // an unreadable file must not create a folder
    chosen.check = [values]() -> Status {
      ASSIGN_OR_RETURN(auto bytes, readWholeFile(values->file, kMaxPeopleFile));
      ASSIGN_OR_RETURN(values->text,
                       utf8TextOf(values->file, std::move(bytes),
                                  values->encoding == "windows-1252" ? TextEncoding::kWindows1252
                                                                     : TextEncoding::kUnicode));
      return {};
    };
    chosen.run = [values](CommandContext& context) {
      return importPeople(context, values->file, values->text, values->lines_above, values->dry_run);
    };
  });
  auto* change = user->add_subcommand("change", "change a person's role, name or full name");
  change->add_option("name", values->name)->required();
  change->add_option("--role", values->role);
  auto* new_name =
      change->add_option("--name", values->text, "the account's new name; what the person did stays theirs");
  auto* full_name = change->add_option("--full-name", values->full_name);
  runs(change, chosen, [values, new_name, full_name](CommandContext& context) -> Status {
    pb::ChangeUser wanted;
    wanted.set_name(values->name);
    if (!values->role.empty()) {
      ASSIGN_OR_RETURN(const auto role, parseRole(values->role));
      wanted.set_role(role);
    }
    if (full_name->count() > 0) wanted.set_full_name(values->full_name);
    if (new_name->count() > 0) wanted.set_new_name(values->text);
    return changeUser(context, wanted);
  });

  user->add_subcommand("list", "list all people")->callback([&chosen] { chosen.run = listUsers; });

  for (const bool enable : {false, true}) {
    auto* command = enable ? user->add_subcommand("enable", "allow a disabled person to log in again")
                           : user->add_subcommand("disable", "block a person's log-in; nothing is deleted");
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

  auto* passwd =
      user->add_subcommand("passwd", "set your own password or, as administrator, another person's");
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
  code->add_flag("--remove", values->remove, "remove the code")->excludes(make)->excludes(file);
  make->excludes(file);
  runs(code, chosen, [values](CommandContext& context) {
    return setCode(context, values->name, values->file, values->make, values->remove);
  });
}

}  // namespace needlelab
