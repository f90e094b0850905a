/// Draws a screen's table of actions as buttons and hints, and takes its keys.
#pragma once

#include <optional>
#include <span>

#include "client/view/model/screen_actions.h"

namespace needlelab {

/// The action whose key was pressed in this frame, if any.
std::optional<int> actionByKey(std::span<const ScreenAction> actions);
/// Big buttons in a row, or, with a width (−1: the rest), below each other. `keys_named`: in the labels.
/// Returns the button that was pressed.
std::optional<int> actionButtons(std::span<const ScreenAction> actions, float width_px = 0,
                                 bool keys_named = false);
/// The same as buttons of the usual size, in the line of a form.
std::optional<int> actionLine(std::span<const ScreenAction> actions, bool keys_named = false);
/// The keys with their hints, in a row.
void actionHints(std::span<const ScreenAction> actions);
/// Keeps from a question what was pressed before the person saw it.
class AnswerGate {
 public:
  /// Call in every frame that can show the question. `asked`: what is asked, 0: nothing; `hidden`: frames
  /// that Dear ImGui measures it before it draws it. Returns whether it can be answered: from the second
  /// frame on, by what is pressed after a frame with it was seen. Draw its buttons disabled until then.
  bool opens(int asked, int hidden = 0);

 private:
  int asked_ = 0, frame_ = 0;
};

/// A question over the screen.
class Question {
 public:
  explicit Question(const char* title) : title_(title) {}
  /// It is drawn from the next `show` on.
  void ask() { opens_ = asked_ = true; }
  /// Returns whether the person is being asked.
  [[nodiscard]] bool asked() const { return asked_; }
  /// Returns whether the last frame showed it, so that it can be answered.
  [[nodiscard]] bool shown() const { return shown_; }
  /// Call in every frame, in the same window of Dear ImGui. Returns the answer by button or key.
  std::optional<int> show(const char* text, std::span<const ScreenAction> actions);

 private:
  const char* title_;
  bool opens_ = false, asked_ = false, shown_ = false;
  AnswerGate gate_;
};

}  // namespace needlelab
