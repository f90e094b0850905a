/// The instructor's window: one frame of whatever screen the desk is on.
#pragma once

#include <memory>
#include <string>

#include "instructor_model/desk.h"
#include "instructor_window/compare_screen.h"
#include "instructor_window/live_screen.h"
#include "instructor_window/replay_screen.h"
#include "instructor_window/rerun_screen.h"
#include "instructor_window/scores_screen.h"
#include "instructor_window/sessions_screen.h"
#include "view/surface.h"

namespace needlelab {

/// Thread: the surface's. `surface` and `desk` outlive it.
class InstructorWindow {
 public:
  /// Errors: as SceneRenderer::make.
  static Result<std::unique_ptr<InstructorWindow>> make(Surface& surface, Desk& desk);

  /// One frame, within beginFrame and endFrame. `read_text`: what is written is kept for `text()`.
  void draw(bool read_text);
  /// What the last frame wrote, in one line.
  [[nodiscard]] const std::string& text() const { return text_; }

  [[nodiscard]] Desk& desk() { return desk_; }
  [[nodiscard]] Surface& surface() { return surface_; }

  LiveScreen live_screen;
  ReplayScreen replay_screen;
  CompareScreen compare_screen;
  RerunScreen rerun_screen;
  SessionsScreen sessions_screen;
  ScoresScreen scores_screen;
  bool show_help = false;

 private:
  InstructorWindow(Surface& surface, Desk& desk, ScenePane live, ScenePane replay, ScenePane first,
                   ScenePane second);
  void drawScreen();
  Surface& surface_;
  Desk& desk_;
  std::string text_;
};

}  // namespace needlelab
