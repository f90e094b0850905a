// needlelab-instructor: watches live, replays, sends messages to the trainee; in a window or a terminal.
#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <limits>
#include <string>

#include "client/instructor/model/stored/report.h"
#include "client/instructor/terminal/headless.h"
#include "client/instructor/window_mode.h"
#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/base/usage/usage.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"

namespace {

std::atomic<bool> interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free, "set from a signal handler");

void onSignal(int) {
  interrupted.store(true, std::memory_order_relaxed);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace needlelab;
  keepOutOfCoreDumps();
  keepProtobufQuiet();
  // On loss of the display Xlib calls `exit`, while the connection's thread still runs.
  keepTlsAtExit();
  InstructorOptions options;
  CLI::App app("needlelab-instructor: watch stations live, replay stored sessions.");
  app.set_version_flag("--version", programText("instructor"));
  app.add_option("--server", options.server,
                 "HOST:PORT of the server, or of several of which any will do: A:7750,B:7750");
  app.add_option("--ca", options.ca, "The server's tls/ca.crt");
  app.add_option("--user", options.user, "Name of an instructor");
  app.add_option("--password-file", options.password_file,
                 "First line is the password; without it the terminal asks");
  app.add_flag("--headless", options.headless, "Lines in this terminal, no window");
  app.add_option("--report", options.report, "Write a report about --session as an HTML file");
  app.add_flag("--replace", options.replace, "Allow --report to overwrite an existing file");
  auto* const screenshot =
      app.add_option("--screenshot", options.screenshot, "Save a PNG of the window")->type_name("FILE");
  app.add_option("--at", options.at_s, "When to take --screenshot: seconds after the window opens")
      ->needs(screenshot)
      ->capture_default_str();
  app.add_flag("--off-screen", options.off_screen, "Draw the window into memory: needs no display");
  app.add_option("--window", options.window_size,
                 "The window's size in pixels, e.g. 1280x720; default: as last used")
      ->type_name("WxH");
  app.add_option("--font-scale", options.font_scale, "Letter size, 0.8 to 2.5")->capture_default_str();
  app.add_option("--station", options.station, "Watch this station; without it an overview of all");
  app.add_option("--session", options.session, "Watch this session (its UUID), or replay it");
  app.add_flag("--replay", options.replay, "Replay the stored session");
  app.add_option(
      "--rate", options.rate_hz,
      "Lines per second: 10 by default, 1 in the overview; 0: all. For a live station or session the "
      "server rounds down to 0.1, 0.2, 0.5, 1, 2, 5, 10, 25, 30, 60, 100, 200, 500 or 1000");
  app.add_option("--speed", options.speed, "Speed of a replay: 1 is real time, 0 as fast as possible")
      ->capture_default_str();
  app.add_option("--seconds", options.seconds, "End after this time; default: on Ctrl-C");
  app.add_option("--message", options.message, "Send this to the trainee at --station");
  app.add_flag("--once", options.once, "End when the message is sent; otherwise keep watching");
  app.add_flag("--json", options.json, "One JSON object a line");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return afterOutput(endOfParsing(app, error, argc, argv), "needlelab-instructor");
  }
  const auto fail = [](const Error& error) {
    std::fprintf(stderr, "needlelab-instructor: %s\n", error.message.c_str());
    return exitCodeOf(error);
  };

  if (const Status ok = checkOptions(options); !ok.ok()) return fail(ok.error());
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  std::signal(SIGHUP, onSignal);  // terminal closed
  const auto stopped = [] { return interrupted.load(std::memory_order_relaxed); };
  if (options.window()) {
    const Status done = runWindowMode(options, stopped);
    endProgram(done.ok() ? kExitDone : fail(done.error()));
  }
  if (const Status is_new = requireNewFile({"--report", options.report}, options.replace); !is_new.ok())
    return fail(is_new.error());
  const auto password = readPassword(options.password_file, "Password of " + options.user + ": ");
  if (!password.ok()) return fail(password.error());
  ClientConfig config = clientConfig(options);
  config.login = personLogin(options.user, *password);
  config.connect_timeout = kConnectOnceTimeout;
  auto client = BlockingClient::connect(config);
  if (!client.ok()) return fail(client.error());
  if (!options.report.empty()) {
    const Status written = writeReport([&](const pb::Request& request) { return client->call(request); },
                                       sessionBytes(options), options.report);
    if (!written.ok()) return fail(written.error());
    std::printf("written: %s\n", options.report.c_str());
    return afterOutput(kExitDone, "needlelab-instructor");
  }
  const std::int64_t end_ns = options.seconds ? client->nowNs() + std::llround(*options.seconds * 1e9)
                                              : std::numeric_limits<std::int64_t>::max();
  const HeadlessRun run{options, *client, std::cout, stopped, end_ns};
  const Status done = runHeadless(run);
  return done.ok() ? afterOutput(kExitDone, "needlelab-instructor") : fail(done.error());
}
