/// The instructor's window: screens, keys, and displayed text.
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

/// Thread: the surface's. `surface` and `lab` must outlive it.
class InstructorWindow {
 public:
  /// Errors: from SceneRenderer::make.
  static Result<std::unique_ptr<InstructorWindow>> make(Surface& surface, LabState& lab);

  /// Draws one frame between beginFrame and endFrame. `read_text`: keep the screen's text for `text()`.
  void draw(bool read_text);
  /// Returns the text of the last frame as one line.
  [[nodiscard]] const std::string& text() const { return text_; }

  [[nodiscard]] LabState& lab() { return lab_; }
  [[nodiscard]] Surface& surface() { return surface_; }

  LabScreen lab_screen;
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

/// Returns the text with each run of whitespace replaced by one space.
std::string flatText(const std::string& text);

// --- running the window, from options to exit code

struct WindowRunOptions {
  LoginForm form;  ///< initial values; with a password, logs in at once
  SurfaceOptions surface;
  std::filesystem::path login_memory;  ///< written after a log-in; empty: none
  std::filesystem::path screenshot;    ///< empty: none
  double screenshot_at_s = 2;          ///< since the first frame; the program ends after it
  std::optional<double> seconds;       ///< end after this time; empty: no limit
  std::string station;                 ///< watched after the log-in; empty: show the lab
  std::string session;                 ///< replayed after the log-in
  /// Called after each frame by a test driver instead of a person; false ends the run. It must log in itself.
  std::function<bool(InstructorWindow&)> driver;
};

/// Runs until the window closes or `stopped` returns true. Thread: the process's first one. Errors: from
/// Surface::open.
Status runInstructorWindow(const WindowRunOptions& options, const std::function<bool()>& stopped);

}  // namespace needlelab
