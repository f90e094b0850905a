#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <exception>
#include <ostream>
#include <utility>

#include "client/admin/command.h"
#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/base/usage/usage.h"

namespace needlelab {
namespace {

Error usage(const std::string& text) {
  return {ErrorCode::kInvalidInput, text};
}

Result<std::unique_ptr<Backend>> openBackend(const GlobalOptions& global, const ChosenCommand& chosen) {
  if (global.data.empty() == global.server.empty()) {
    return usage(
        "give either --data DIR (a stopped server's folder) or --server HOST:PORT --ca FILE --user NAME");
  }
  if (!global.data.empty())
    return openFolder(global.data, chosen.may_create, chosen.encrypt_with, global.store);
  if (!global.store.empty()) return usage("--store goes with --data: a server that runs has its own");
  if (!chosen.encrypt_with.empty())
    return usage(
        "--encrypt-with goes with --data: a server that runs encrypts with a key of its own "
        "(needlelab-server "
        "--backup-key FILE), so that the key never crosses the network");
  if (global.ca.empty()) return usage("--server needs --ca FILE, the server's tls/ca.crt");
  if (global.user.empty()) return usage("--server needs --user NAME");
  ASSIGN_OR_RETURN(const auto servers, parseEndpoints(global.server));
  ASSIGN_OR_RETURN(const auto password, global.password_file.empty()
                                            ? askPassword("password of " + global.user, "--password-file")
                                            : passwordFromFile(global.password_file));
  return connectServer({servers, global.ca, global.user, password});
}

/// Removes a new data folder after a command failed with an error or an exception.
struct DiscardUnlessDone {
  explicit DiscardUnlessDone(Backend& of) : backend(of) {}
  DiscardUnlessDone(const DiscardUnlessDone&) = delete;
  DiscardUnlessDone& operator=(const DiscardUnlessDone&) = delete;
  ~DiscardUnlessDone() {
    try {
      if (!done) backend.discardIfNew();
    } catch (const std::exception&) {
      // only the command's own failure is reported
    }
  }
  Backend& backend;
  bool done = false;
};

int fail(std::ostream& err, const Error& error) {
  err << "needlelab-admin: " << error.message << "\n";
  return exitCodeOf(error);
}

}  // namespace

void runs(CLI::App* command, ChosenCommand& chosen, std::function<Status(CommandContext&)> run) {
  command->callback([&chosen, run = std::move(run)] { chosen.run = run; });
}

CLI::Option* addNewFile(CLI::App* command, ChosenCommand& chosen, std::string& file,
                        const std::string& help) {
  command->add_flag("--replace", chosen.replace, "allow --out to overwrite an existing file");
  command->parse_complete_callback([&chosen, &file] { chosen.new_file = {"--out", file}; });
  return command->add_option("--out", file, help)->type_name("FILE");
}

CLI::Option* addFormat(CLI::App* command, std::string& name, ExportPlace place, const std::string& help) {
  std::vector<std::string> names;
  for (const ExportFormat* const format : formatsAt(place)) names.emplace_back(format->name);
  return command->add_option("--format", name, help)->check(CLI::IsMember(names));
}

int runAdmin(int argc, const char* const* argv, std::ostream& out, std::ostream& err) try {
  CLI::App app{
      "needlelab-admin: people, groups, stations, profiles, courses, results, sessions, studies, backup"};
  app.set_version_flag("--version", "needlelab-admin " + programVersion());
  app.require_subcommand(1);
  app.fallthrough();  // the options below are allowed after the subcommand, too
  app.footer(
      "Works on a running server (--server, --ca, --user) or on the folder of a stopped one (--data).\n"
      "Passwords come from files or the terminal, never from arguments.\n"
      "Exit codes: 0 done, 1 failed or refused, 2 wrong usage or input.");

  GlobalOptions global;
  std::optional<std::string> json;
  app.add_option("--data", global.data, "folder of a stopped server")->type_name("DIR");
  app.add_option("--store", global.store,
                 "with --data, at the first use of DIR: its database is on PostgreSQL, at "
                 "postgresql://USER@HOST/DATABASE (DIR/store remembers it)")
      ->type_name("URL");
  app.add_option("--server", global.server, "a running server; of several, the first that answers")
      ->type_name("HOST:PORT[,…]");
  app.add_option("--ca", global.ca, "the server's certificate authority, its tls/ca.crt")->type_name("FILE");
  app.add_option("--user", global.user, "the account that logs in")->type_name("NAME");
  app.add_option("--password-file", global.password_file, "first line: the password; else it is asked for")
      ->type_name("FILE");
  app.add_option_function<std::string>(
         "--json", [&json](const std::string& file) { json = file; },
         "JSON instead of tables; to standard output without FILE (put it last, or write --json=FILE)")
      ->type_name("[FILE]")
      ->expected(0, 1)
      ->default_str("");

  ChosenCommand chosen;
  addUserCommands(app, global, chosen);
  addStationCommands(app, chosen);
  addProfileCommands(app, chosen);
  addCurriculumCommands(app, chosen);
  addSessionCommands(app, chosen);
  addCertificateCommands(app, chosen);
  addUpkeepCommands(app, global, chosen);
  addAuditCommands(app, chosen);
  addRetentionCommands(app, chosen);
  addTeachingCommands(app, chosen);
  addScoreCommands(app, chosen);
  addPersonCommands(app, chosen);
  addStoreCommands(app, global, chosen);
  addServerCommands(app, chosen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return endOfParsing(app, e, argc, argv, out, err);
  }
  // with --server, a password file given only to `user add` is for the log-in
  if (!global.server.empty() && global.password_file.empty())
    std::swap(global.password_file, chosen.new_password_file);

  if (const auto is_new = requireNewFile(chosen.new_file, chosen.replace); !is_new)
    return fail(err, is_new.error());
  if (chosen.check) {
    if (const auto valid = chosen.check(); !valid) return fail(err, valid.error());
  }
  Output output(out, err, json);
  if (chosen.run_without_folder) {
    if (const auto done = chosen.run_without_folder(output); !done) return fail(err, done.error());
    return kExitDone;
  }
  if (!global.data.empty()) {
    if (const auto owned = checkFolderUser(global.data, ::geteuid()); !owned) return fail(err, owned.error());
  }
  if (chosen.run_on_files) {
    if (global.data.empty() || !global.server.empty())
      return fail(err,
                  usage("this works on the files of a server's folder: give --data DIR, on its machine"));
    if (const auto done = chosen.run_on_files(global.data, output); !done) return fail(err, done.error());
    return kExitDone;
  }
  auto backend = openBackend(global, chosen);
  if (!backend) return fail(err, backend.error());
  DiscardUnlessDone discard(**backend);
  CommandContext context{**backend, output, global};
  if (const auto done = chosen.run(context); !done) return fail(err, done.error());
  discard.done = true;
  return kExitDone;
} catch (const std::exception& e) {
  // out of memory, or a file system error: report it in one line, without a trace
  err << "needlelab-admin: " << e.what() << "\n";
  return kExitFailed;
}

Status eachPage(Backend& backend, const std::function<void(pb::Request&, const std::string&)>& ask,
                const std::function<std::string(const pb::Reply&)>& take) {
  std::string page;
  do {
    pb::Request request;
    ask(request, page);
    ASSIGN_OR_RETURN(const auto reply, backend.call(request));
    page = take(reply);
  } while (!page.empty());
  return {};
}

Result<Uuid> sessionIdOf(CommandContext& context, const std::string& text) {
  constexpr std::size_t kLeast = 4, kWhole = 36, kNamed = 5;
  const bool newest = text == "newest";
  const bool is_beginning = text.size() >= kLeast && text.size() < kWhole &&
                            text.find_first_not_of("0123456789abcdefABCDEF-") == std::string::npos;
  if (!newest && !is_beginning) {
    auto id = parseUuid(text);
    if (!id) return usage("session id: " + id.error().message + ", or its first 4 or more, or newest");
    return id;
  }
  std::vector<Uuid> found;
  std::string names;
  RETURN_IF_ERROR(eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        request.mutable_list_sessions()->set_limit(newest ? 1 : 0);
        request.mutable_list_sessions()->set_page(page);
      },
      [&](const pb::Reply& reply) {
        for (const auto& session : reply.sessions().sessions()) {
          const auto id = uuidOf(session.description().session_id());
          if (!id || (!newest && !uuidText(*id).starts_with(lowerCase(text)))) continue;
          found.push_back(*id);
          if (found.size() <= kNamed)
            names += fmt::format("\n  {}  {}  {}  {}", uuidText(*id),
                                 localTime(session.description().started_unix_ns(), TimeForm::kZoned),
                                 session.description().trainee(), session.description().exercise_id());
        }
        return newest ? std::string() : reply.sessions().next_page();
      }));
  if (found.empty())
    return Error{ErrorCode::kNotFound,
                 newest ? "there is no session yet"
                        : "no session's id begins with '" + text + "': session list shows them"};
  if (found.size() > 1)
    return usage(fmt::format("the ids of {} sessions begin with '{}':{}{}", found.size(), text, names,
                             found.size() > kNamed ? "\n  and more" : ""));
  return found.front();
}

Status writeText(Output& output, const std::string& file, const std::string& text) {
  if (!file.empty()) return writeFileAtomically(file, viewOf(text));
  output.document(text);
  return {};
}

Result<std::int64_t> momentOf(const std::string& field, const std::string& text) {
  const auto wrong = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, field + ": '" + text + "' " + why +
                                               "; write it as 2026-12-01T18:00Z or 2026-12-01T18:00+01:00"};
  };
  std::tm parts{};
  int used = 0;
  if (std::sscanf(text.c_str(), "%4d-%2d-%2dT%2d:%2d%n", &parts.tm_year, &parts.tm_mon, &parts.tm_mday,
                  &parts.tm_hour, &parts.tm_min, &used) != 5)
    return wrong("is not a time");
  std::string zone = text.substr(static_cast<std::size_t>(used));
  if (zone.starts_with(":")) {
    int more = 0;
    if (std::sscanf(zone.c_str(), ":%2d%n", &parts.tm_sec, &more) != 1) return wrong("is not a time");
    zone.erase(0, static_cast<std::size_t>(more));
  }
  int offset_s = 0;
  if (zone != "Z") {
    int hours = 0, minutes = 0, more = 0;
    char sign = 0;
    if (std::sscanf(zone.c_str(), "%c%2d:%2d%n", &sign, &hours, &minutes, &more) != 3 ||
        static_cast<std::size_t>(more) != zone.size() || (sign != '+' && sign != '-') || hours > 14 ||
        minutes > 59)
      return wrong(zone.empty() ? "has no time zone" : "has no time zone that is known");
    offset_s = (hours * 3600 + minutes * 60) * (sign == '-' ? -1 : 1);
  }
  const std::tm given = parts;
  parts.tm_year -= 1900;
  parts.tm_mon -= 1;
  const std::time_t seconds = ::timegm(&parts);
  // timegm accepts 31 February and returns a day in March
  if (parts.tm_mon + 1 != given.tm_mon || parts.tm_mday != given.tm_mday || parts.tm_hour != given.tm_hour ||
      parts.tm_min != given.tm_min || given.tm_year < 1970 || given.tm_year > 2261)
    return wrong("is not a valid date or time");
  return (static_cast<std::int64_t>(seconds) - offset_s) * 1'000'000'000;
}

Result<std::string> askPassword(const std::string& prompt, const std::string& option) {
  return passwordFromTerminal(prompt + ": ", kMostPasswordBytes,
                              prompt + ": there is no terminal to ask on; give " + option + " FILE");
}

Result<std::string> promptNewSecret(const std::string& what, const std::string& name,
                                    const std::string& option) {
  auto first = askPassword("new " + what + " of " + name, option);
  if (!first) return first;
  const auto second = askPassword("the same again", option);
  if (!second) return second;
  if (*first != *second)
    return Error{ErrorCode::kInvalidInput, "the two " + what + "s differ: nothing was changed"};
  return first;
}

}  // namespace needlelab
