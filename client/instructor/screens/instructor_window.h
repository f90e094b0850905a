/// The instructor's window: one frame of whatever screen the desk is on.
#pragma once

#include <memory>
#include <string>

#include "client/instructor/model/desk.h"
#include "client/instructor/screens/compare_screen.h"
#include "client/instructor/screens/live_screen.h"
#include "client/instructor/screens/replay_screen.h"
#include "client/instructor/screens/rerun_screen.h"
#include "client/instructor/screens/scores_screen.h"
#include "client/instructor/screens/sessions_screen.h"
#include "client/view/surface.h"

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
