#include "client/instructor/window_mode.h"

#include <cstdlib>
#include <system_error>

#include "client/instructor/model/lab_state.h"
#include "client/instructor/screens/instructor_window.h"
#include "client/net/link/credentials.h"

namespace needlelab {
namespace {

/// The folder that keeps the window's position and the log-in between runs; empty: none.
std::filesystem::path stateFolder() {
  if (const char* state = std::getenv("XDG_STATE_HOME"); state != nullptr && *state == '/')
    return std::filesystem::path(state) / "needlelab";
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return std::filesystem::path(home) / ".local" / "state" / "needlelab";
  return {};
}

}  // namespace

Status runWindowMode(const InstructorOptions& options, const std::function<bool()>& stopped) {
  WindowRunOptions run;
  // screenshots always start from the same state
  if (const auto folder = stateFolder(); options.screenshot.empty() && !folder.empty()) {
    std::error_code ignored;
    std::filesystem::create_directories(folder, ignored);
    run.surface.state_file = folder / "instructor-window.json";
    run.login_memory = folder / "instructor-login.json";
    recallLogin(run.login_memory, run.form);
  }
  if (!options.server.empty()) run.form.server = options.server;
  if (!options.ca.empty()) run.form.ca_file = std::filesystem::absolute(options.ca).string();
  if (!options.user.empty()) run.form.user = options.user;
  if (!options.password_file.empty()) {
    ASSIGN_OR_RETURN(run.form.password, readPassword(options.password_file, {}));
  }
  run.surface.kind = options.off_screen           ? SurfaceOptions::Kind::kOffScreen
                     : options.screenshot.empty() ? SurfaceOptions::Kind::kWindow
                                                  : SurfaceOptions::Kind::kAny;
  run.surface.title = "needlelab: instructor";
  ASSIGN_OR_RETURN(const auto size, windowSizeOf(options));
  run.surface.width_px = size.width_px;
  run.surface.height_px = size.height_px;
  run.surface.font_scale = options.font_scale;
  run.screenshot = options.screenshot;
  run.screenshot_at_s = options.at_s;
  run.seconds = options.seconds;
  run.station = options.station;
  run.session = options.session;
  return runInstructorWindow(run, stopped);
}

}  // namespace needlelab
