// instructor_script: the instructor's window, driven by a script in a person's place.
#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>

#include "client/instructor/screens/instructor_window.h"
#include "client/net/link/credentials.h"
#include "common/base/program.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"
#include "tests/windows/script/script_runner.h"

namespace needlelab {
namespace {

std::atomic<bool> interrupted{false};

void onSignal(int) {
  interrupted.store(true, std::memory_order_relaxed);
}

Status runScript(const std::filesystem::path& script, const std::filesystem::path& password_file,
                 WindowRunOptions run) {
  ASSIGN_OR_RETURN(auto actions, loadScript(script));
  ASSIGN_OR_RETURN(run.form.password, readPassword(password_file, {}));
  ScriptRunner runner(std::move(actions), script.string(), [](const std::string& line) {
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
  });
  run.surface.title = "needlelab: instructor";
  run.driver = [&](InstructorWindow& window) {
    runner.afterFrame(window);
    return !runner.over();
  };
  RETURN_IF_ERROR(runInstructorWindow(run, [] { return interrupted.load(std::memory_order_relaxed); }));
  return runner.status();
}

}  // namespace
}  // namespace needlelab

int main(int argc, char** argv) {
  using namespace needlelab;
  keepProtobufQuiet();
  keepTlsAtExit();
  WindowRunOptions run;
  std::filesystem::path script, password_file;
  bool off_screen = false;
  CLI::App app("instructor_script: the instructor's window does what a file lists.");
  app.add_option("--server", run.form.server, "HOST:PORT")->required();
  app.add_option("--ca", run.form.ca_file, "The server's tls/ca.crt")->required();
  app.add_option("--user", run.form.user, "Name of an instructor")->required();
  app.add_option("--password-file", password_file, "First line is the password")->required();
  app.add_option("--script", script, "Do what this file lists, then end")->required();
  app.add_flag("--off-screen", off_screen, "Draw the window into memory: needs no display");
  app.add_option("--width", run.surface.width_px, "Of the window, in pixels: 1280 unless given");
  app.add_option("--height", run.surface.height_px, "720 unless given");
  app.add_option("--font-scale", run.surface.font_scale, "Size of the letters: 1 unless given");
  CLI11_PARSE(app, argc, argv);
  run.surface.kind = off_screen ? SurfaceOptions::Kind::kOffScreen : SurfaceOptions::Kind::kAny;
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const Status done = runScript(script, password_file, std::move(run));
  if (!done.ok()) std::fprintf(stderr, "instructor_script: %s\n", done.error().message.c_str());
  endProgram(done.ok() ? kExitDone : exitCodeOf(done.error()));
}
