#include "client/instructor/screens/window_run.h"

#include <epoxy/gl.h>

#include <cstdio>
#include <functional>
#include <utility>

#include "client/instructor/model/login_memory.h"
#include "client/instructor/screens/instructor_window.h"
#include "client/instructor/screens/script_runner.h"
#include "common/base/clock.h"
#include "common/fem/needle_mesh.h"

namespace needlelab {
namespace {

double secondsSince(std::int64_t began_ns) {
  return 1e-9 * static_cast<double>(steadyNowNs() - began_ns);
}

}  // namespace

Status runInstructorWindow(const WindowRunOptions& options, const std::function<bool()>& stopped) {
  std::optional<ScriptRunner> script;
  if (!options.script.empty()) {
    auto actions = loadScript(options.script);
    if (!actions.ok()) return actions.error();
    script.emplace(std::move(*actions), options.script.string(), [](const std::string& line) {
      std::printf("%s\n", line.c_str());
      std::fflush(stdout);
    });
  }
  auto surface = Surface::open(options.surface);
  if (!surface.ok()) return surface.error();
  Desk desk(addCompliance);
  desk.form = options.form;
  auto window = InstructorWindow::make(**surface, desk);
  if (!window.ok()) return window.error();
  if (!desk.form.password.empty() && !script) desk.logIn();

  const std::int64_t began_ns = steadyNowNs();
  bool pictured = options.screenshot.empty(), arrived = false;
  Status result;
  while (!stopped() && (*surface)->beginFrame()) {
    desk.update(secondsSince(began_ns));
    if (desk.inside() && !std::exchange(arrived, true)) {
      // what cannot be kept is typed again
      if (!options.login_memory.empty()) (void)rememberLogin(options.login_memory, desk.form).ok();
      if (!options.station.empty()) desk.open(options.station);
      if (!options.session.empty()) {
        desk.bench.loadFirst(options.session);
        desk.screen = DeskScreen::kReplay;
      }
    }
    (*window)->draw(script.has_value());
    (*surface)->endFrame();
    // drawn, not only asked for: latency counts to here
    glFinish();
    desk.presented(wallNowNs());
    if (script) script->afterFrame(**window);
    if (!pictured && secondsSince(began_ns) >= options.screenshot_at_s) {
      pictured = true;
      result = savePng((*surface)->picture(), options.screenshot);
      if (!result.ok() || !script) break;
    }
    if (script && script->over()) {
      if (result.ok()) result = script->status();
      break;
    }
    if (options.seconds && secondsSince(began_ns) >= *options.seconds) break;
  }
  return result;
}

}  // namespace needlelab
