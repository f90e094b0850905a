#include "client/admin/app.h"

#include <CLI/CLI.hpp>
#include <exception>
#include <ostream>

#include "client/admin/command.h"
#include "client/admin/secrets.h"
#include "common/base/files.h"
#include "common/base/program.h"

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
  if (!global.data.empty()) return openFolder(global.data, chosen.may_create);
  if (global.ca.empty()) return usage("--server needs --ca FILE, the server's tls/ca.crt");
  if (global.user.empty()) return usage("--server needs --user NAME");
  const auto endpoint = parseEndpoint(global.server);
  if (!endpoint) return endpoint.error();
  const auto password = global.password_file.empty()
                            ? passwordFromTerminal("password of " + global.user, "--password-file")
                            : passwordFromFile(global.password_file);
  if (!password) return password.error();
  return connectServer({*endpoint, global.ca, global.user, *password});
}

int fail(std::ostream& err, const Error& error) {
  err << "needlelab-admin: " << error.message << "\n";
  return exitCodeOf(error);
}

}  // namespace

int runAdmin(int argc, const char* const* argv, std::ostream& out, std::ostream& err) try {
  CLI::App app{
      "needlelab-admin: people, groups, stations, profiles, courses, results, sessions, studies, backup"};
  app.set_version_flag("--version", std::string("needlelab-admin ") + NEEDLELAB_VERSION);
  app.require_subcommand(1);
  app.fallthrough();  // the options below may stand after the subcommand, too
  app.footer(
      "Works on a running server (--server, --ca, --user) or on the folder of a stopped one (--data).\n"
      "Passwords come from files or the terminal, never from arguments.\n"
      "Exit codes: 0 done, 1 failed or refused, 2 wrong usage or input.");

  GlobalOptions global;
  std::optional<std::string> json;
  app.add_option("--data", global.data, "folder of a stopped server")->type_name("DIR");
  app.add_option("--server", global.server, "a running server")->type_name("HOST:PORT");
  app.add_option("--ca", global.ca, "the server's certificate authority, its tls/ca.crt")->type_name("FILE");
  app.add_option("--user", global.user, "who logs in")->type_name("NAME");
  app.add_option("--password-file", global.password_file, "first line: the password; else it is asked for")
      ->type_name("FILE");
  app.add_option_function<std::string>(
         "--json", [&json](const std::string& file) { json = file; },
         "JSON in place of tables; to standard output without FILE (put it last, or write --json=FILE)")
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
  addUpkeepCommands(app, chosen);
  addRetentionCommands(app, chosen);
  addTeachingCommands(app, chosen);
  addScoreCommands(app, chosen);
  addPersonCommands(app, chosen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    // 0 for --help and --version; CLI11's other codes are all wrong usage here
    return app.exit(e, out, err) == 0 ? kExitDone : kExitInvalid;
  }
  // a password file given to `user add` alone: with --server it is needed to log in
  if (!global.server.empty() && global.password_file.empty())
    std::swap(global.password_file, chosen.new_password_file);

  if (chosen.check) {
    if (const auto valid = chosen.check(); !valid) return fail(err, valid.error());
  }
  Output output(out, err, json);
  if (chosen.run_on_files) {
    if (global.data.empty() || !global.server.empty())
      return fail(err,
                  usage("this works on the files of a server's folder: give --data DIR, on its machine"));
    if (const auto done = chosen.run_on_files(global.data, output); !done) return fail(err, done.error());
    return kExitDone;
  }
  auto backend = openBackend(global, chosen);
  if (!backend) return fail(err, backend.error());
  CommandContext context{**backend, output, global};
  if (const auto done = chosen.run(context); !done) return fail(err, done.error());
  return kExitDone;
} catch (const std::exception& e) {
  // out of memory, or the file system: said in a line, never with a trace
  err << "needlelab-admin: " << e.what() << "\n";
  return kExitFailed;
}

Status eachPage(Backend& backend, const std::function<void(pb::Request&, const std::string&)>& ask,
                const std::function<std::string(const pb::Reply&)>& take) {
  std::string page;
  do {
    pb::Request request;
    ask(request, page);
    const auto reply = backend.call(request);
    if (!reply) return reply.error();
    page = take(*reply);
  } while (!page.empty());
  return {};
}

Result<Uuid> sessionIdOf(const std::string& text) {
  auto id = parseUuid(text);
  if (!id) return usage("session id: " + id.error().message);
  return id;
}

Status writeText(Output& output, const std::string& file, const std::string& text) {
  if (!file.empty()) return writeFileAtomically(file, viewOf(text));
  output.text(text);
  return {};
}

}  // namespace needlelab
