// needlelab-server: stores what stations record, serves people, fans out live samples.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "base/exit_code.h"
#include "server/log.h"
#include "server/server.h"

namespace {

/// A thousand stations need a thousand sockets; the usual soft limit is 1024 files.
void raiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= limit.rlim_max) return;
  limit.rlim_cur = limit.rlim_max;
  if (setrlimit(RLIMIT_NOFILE, &limit) != 0) {
    needlelab::logEvent(needlelab::LogLevel::kWarning, "file_limit_not_raised", {});
  }
}

}  // namespace

int main(int argc, char** argv) try {
  needlelab::ServerOptions options;
  options.handle_signals = true;
  std::string log_level = "info";

  CLI::App app("needlelab-server: stores what stations record, serves people, fans out live samples.");
  app.set_version_flag("--version", "needlelab-server " NEEDLELAB_VERSION);
  app.add_option("--data", options.data, "Folder of the database and of tls/; made at the first start")
      ->required();
  app.add_option("--listen", options.listen, "HOST:PORT to listen on; port 0 picks a free one")
      ->capture_default_str();
  app.add_option("--port-file", options.port_file, "Write the port to this file once the server listens");
  app.add_option("--host-name", options.host_names,
                 "Further name or address for the server's certificate; may be repeated");
  app.add_option("--log-level", log_level, "debug, info, warning, error or off")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? needlelab::kExitDone : needlelab::kExitInvalid;
  }

  const auto fail = [](const needlelab::Error& error) {
    std::fprintf(stderr, "needlelab-server: %s\n", error.message.c_str());
    return needlelab::exitCodeOf(error);
  };
  const auto level = needlelab::parseLogLevel(log_level);
  if (!level.ok()) return fail(level.error());
  needlelab::setLogLevel(*level);
  raiseFileLimit();
  auto server = needlelab::Server::start(std::move(options));
  if (!server.ok()) return fail(server.error());
  return (*server)->run();
} catch (const std::exception& error) {
  // out of memory or threads: said in a line; what was not acknowledged is still in the stations' spools
  std::fprintf(stderr, "needlelab-server: %s\n", error.what());
  return needlelab::kExitFailed;
}
