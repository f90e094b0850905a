#include <algorithm>
#include <memory>

#include "client/admin/command.h"
#include "client/admin/secrets.h"
#include "common/base/files.h"
#include "common/base/text.h"
#include "db/service/roles.h"

namespace needlelab {
namespace {

/// trainee, instructor, curriculum-manager, administrator; short forms and the names of the protocol as well.
Result<pb::Role> parseRole(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(c == '_' ? '-' : std::tolower(c)); });
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
  return file.empty() ? newPasswordFromTerminal(name, "--new-password-file") : passwordFromFile(file);
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
                              {"created_unix_ns", "SINCE", Column::Kind::kTime}},
                             rows, "nobody yet");
}

/// A table of people; what happens to each row, and what is wrong where.
Status importPeople(CommandContext& context, const std::string& file, bool dry_run) {
  const auto text = readWholeFile(file, 900'000);
  if (!text) return text.error();
  pb::Request request;
  request.mutable_import_people()->set_csv(*text);
  request.mutable_import_people()->set_dry_run(dry_run);
  const auto reply = context.backend.call(request);
  if (!reply) return Error{reply.error().code, file + ": " + reply.error().message};
  const auto& report = reply->people_import();
  Json rows = Json::array();
  for (const auto& row : report.rows()) {
    std::string what = pb::PeopleImport::What_Name(row.what());
    std::transform(what.begin(), what.end(), what.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    rows.push_back({{"line", row.line()},
                    {"name", row.name()},
                    {"what", what},
                    {"column", row.column()},
                    {"text", row.text()}});
  }
  if (auto done = context.output.list(
          {{"line", "LINE"}, {"name", "NAME"}, {"what", "WHAT"}, {"column", "COLUMN"}, {"text", "WHY"}}, rows,
          "no rows");
      !done)
    return done;
  if (report.faults() > 0)
    return Error{ErrorCode::kInvalidInput, file + ": " + std::to_string(report.faults()) +
                                               " rows cannot be taken: nothing was changed"};
  context.output.done((report.done() ? "" : "a dry run: ") + std::to_string(report.added()) + " added, " +
                      std::to_string(report.changed()) + " changed, " + std::to_string(report.unchanged()) +
                      " as they were");
  return {};
}

/// As the person is now, with what the command says in its place.
Status changeUser(CommandContext& context, pb::ChangeUser change) {
  pb::Request show;
  show.mutable_get_user()->set_name(change.name());
  const auto now = context.backend.call(show);
  if (!now) return now.error();
  change.set_base_revision(now->user().revision());
  pb::Request request;
  *request.mutable_change_user() = change;
  const auto reply = context.backend.call(request);
  if (!reply) return reply.error();
  context.output.done("'" + change.name() + "' is revision " + std::to_string(reply->user().revision()));
  return {};
}

}  // namespace

void addUserCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen) {
  auto* user = app.add_subcommand("user", "people and their roles");
  user->require_subcommand(1);

  struct Values {
    std::string name, role, full_name, file;
    bool dry_run = false;
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
      const auto role = parseRole(values->role);
      if (!role) return role.error();
      return checkNewName("name", values->name);
    };
    chosen.run = [&global, &chosen, values](CommandContext& context) -> Status {
      const auto role = parseRole(values->role);
      // on a folder nobody logs in: a file given before the subcommand can only be the new password's
      std::string file = chosen.new_password_file;
      if (file.empty() && context.backend.local()) file = global.password_file;
      pb::Request request;
      request.mutable_add_user()->set_name(values->name);
      request.mutable_add_user()->set_role(*role);
      request.mutable_add_user()->set_full_name(values->full_name);
      if (*role != pb::TRAINEE || !file.empty()) {
        const auto password = newPassword(values->name, file);
        if (!password) return password.error();
        request.mutable_add_user()->set_password(*password);
      }
      if (const auto reply = context.backend.call(request); !reply) return reply.error();
      context.output.done("added " + std::string(roleName(*role)) + " '" + values->name + "'");
      return {};
    };
  });

  auto* import_people = user->add_subcommand("import", "people from a table: all rows or none");
  import_people
      ->add_option("file", values->file,
                   "columns name, full_name, role, group, password; only name must be there")
      ->required()
      ->type_name("FILE.csv");
  import_people->add_flag("--dry-run", values->dry_run, "only say what would happen");
  import_people->callback([&chosen, values] {
    chosen.may_create = true;
    chosen.run = [values](CommandContext& context) {
      return importPeople(context, values->file, values->dry_run);
    };
  });
  auto* change = user->add_subcommand("change", "another role or full name");
  change->add_option("name", values->name)->required();
  change->add_option("--role", values->role);
  auto* full_name = change->add_option("--full-name", values->full_name);
  change->callback([&chosen, values, full_name] {
    chosen.run = [values, full_name](CommandContext& context) -> Status {
      pb::ChangeUser wanted;
      wanted.set_name(values->name);
      if (!values->role.empty()) {
        const auto role = parseRole(values->role);
        if (!role) return role.error();
        wanted.set_role(*role);
      }
      if (full_name->count() > 0) wanted.set_full_name(values->full_name);
      return changeUser(context, wanted);
    };
  });

  user->add_subcommand("list", "everybody")->callback([&chosen] { chosen.run = listUsers; });

  for (const bool enable : {false, true}) {
    auto* command = enable ? user->add_subcommand("enable", "undo a disable")
                           : user->add_subcommand("disable", "no more log-in; nothing is deleted");
    command->add_option("name", values->name)->required();
    command->callback([&chosen, values, enable] {
      chosen.run = [values, enable](CommandContext& context) -> Status {
        pb::Request request;
        request.mutable_disable_user()->set_name(values->name);
        request.mutable_disable_user()->set_enable(enable);
        if (const auto reply = context.backend.call(request); !reply) return reply.error();
        context.output.done((enable ? "enabled '" : "disabled '") + values->name + "'");
        return {};
      };
    });
  }

  auto* passwd = user->add_subcommand("passwd", "set a password: one's own, or as administrator anybody's");
  passwd->add_option("name", values->name)->required();
  add_password_options(passwd);
  passwd->callback([&global, &chosen, values] {
    chosen.run = [&global, &chosen, values](CommandContext& context) -> Status {
      std::string file = chosen.new_password_file;
      if (file.empty() && context.backend.local()) file = global.password_file;
      const auto password = newPassword(values->name, file);
      if (!password) return password.error();
      pb::Request request;
      request.mutable_set_password()->set_name(values->name);
      request.mutable_set_password()->set_password(*password);
      if (const auto reply = context.backend.call(request); !reply) return reply.error();
      context.output.done("password of '" + values->name + "' set");
      return {};
    };
  });
}  // namespace needlelab

}  // namespace needlelab
