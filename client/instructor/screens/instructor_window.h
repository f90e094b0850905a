/// The instructor's window: its screens, its keys, and its text for scripts.
#pragma once

#include <memory>
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

}  // namespace needlelab
