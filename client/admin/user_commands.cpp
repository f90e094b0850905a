#include <algorithm>
#include <memory>

#include "admin/command.h"
#include "admin/secrets.h"
#include "base/text_rules.h"
#include "service/roles.h"

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
    return Error{
        ErrorCode::kInvalidInput,
        "--role: '" + text + "', allowed are trainee, instructor, curriculum-manager, administrator"};
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
          rows.push_back({{"name", user.name()},
                          {"role", roleName(user.role())},
                          {"disabled", user.disabled()},
                          {"has_password", user.has_password()},
                          {"created_unix_ns", user.created_unix_ns()}});
        }
        return reply.users().next_page();
      });
  if (!done) return done;
  return context.output.list({{"name", "NAME"},
                              {"role", "ROLE"},
                              {"disabled", "DISABLED"},
                              {"has_password", "PASSWORD"},
                              {"created_unix_ns", "SINCE", Column::Kind::kTime}},
                             rows, "nobody yet");
}

}  // namespace

void addUserCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen) {
  auto* user = app.add_subcommand("user", "people and their roles");
  user->require_subcommand(1);

  struct Values {
    std::string name, role;
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
  add->add_option("--role", values->role, "trainee, instructor, curriculum-manager or administrator")
      ->required();
  add_password_options(add);
  add->callback([&global, &chosen, values] {
    chosen.may_create = true;
    chosen.check = [values]() -> Status {
      const auto role = parseRole(values->role);
      if (!role) return role.error();
      return checkName("name", values->name);
    };
    chosen.run = [&global, &chosen, values](CommandContext& context) -> Status {
      const auto role = parseRole(values->role);
      // on a folder nobody logs in: a file given before the subcommand can only be the new password's
      std::string file = chosen.new_password_file;
      if (file.empty() && context.backend.local()) file = global.password_file;
      pb::Request request;
      request.mutable_add_user()->set_name(values->name);
      request.mutable_add_user()->set_role(*role);
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
}

}  // namespace needlelab
