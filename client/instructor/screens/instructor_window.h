/// The instructor's window: its screens, its keys, and its text for scripts.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "client/instructor/model/lab_state.h"
#include "client/instructor/screens/screens.h"
#include "client/view/surface.h"

namespace needlelab {

/// Thread: the surface's. `surface` and `lab` outlive it.
class InstructorWindow {
 public:
  /// Errors: as SceneRenderer::make.
  static Result<std::unique_ptr<InstructorWindow>> make(Surface& surface, LabState& lab);

  /// Draws one frame, within beginFrame and endFrame. `read_text`: keeps the text of the screen for `text()`.
  void draw(bool read_text);
  /// The text of the last frame, in one line.
  [[nodiscard]] const std::string& text() const { return text_; }

  [[nodiscard]] LabState& lab() { return lab_; }
  [[nodiscard]] Surface& surface() { return surface_; }

  LiveScreen live_screen;
  ReplayScreen replay_screen;
  CompareScreen compare_screen;
  RerunScreen rerun_screen;
  SessionsScreen sessions_screen;
  ScoresScreen scores_screen;
  bool show_help = false;

 private:
  InstructorWindow(Surface& surface, LabState& lab, ScenePane live, ScenePane replay, ScenePane first,
                   ScenePane second);
  void drawScreen();
  Surface& surface_;
  LabState& lab_;
  std::string text_;
};

/// The text with each run of spaces and line ends as one space: how scripts compare what stands on the
/// screen.
std::string flatText(const std::string& text);

// --- the window from options to the exit code

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
