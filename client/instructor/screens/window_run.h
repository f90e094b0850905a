/// `needlelab-instructor` with a window: from options to the exit code.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "client/instructor/model/lab_state.h"
#include "client/view/surface.h"

namespace needlelab {

struct WindowRunOptions {
  LoginForm form;  ///< the known fields; with a password: logs in at once
  SurfaceOptions surface;
  std::filesystem::path login_memory;  ///< written after a log-in; empty: none
  std::filesystem::path script;        ///< empty: none; its end is the program's end
  std::filesystem::path screenshot;    ///< empty: none
  double screenshot_at_s = 2;  ///< since the first frame; after it the program ends, unless there is a script
  std::optional<double> seconds;  ///< end after so long
  std::string station;            ///< looked over once logged in; empty: the lab is shown
  std::string session;            ///< replayed once logged in
};

/// Runs until the window is closed, the script ends, SIGINT or SIGTERM. Thread: the process's first one.
/// Errors: those of Surface::open, of the script (kFailed: an action, with file and line), kInvalidInput (its
/// text).
Status runInstructorWindow(const WindowRunOptions& options, const std::function<bool()>& stopped);

}  // namespace needlelab
